"""The thesis as data: structures, setups, stated values, trends, numbers and readings."""
