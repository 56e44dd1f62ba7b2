"""The law of rounding for the design of a measurement."""
