"""The thesis as data: structures, setups, claimed values, trends, numbers, interpretations."""
