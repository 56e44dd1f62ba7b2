"""The thesis as data: structures, setups, stated figures, trends, numbers and readings."""
