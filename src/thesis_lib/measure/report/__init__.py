"""The page, the figures and the files of a measurement."""
