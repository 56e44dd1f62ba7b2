"""The law of rounding, for those who design a measurement."""
