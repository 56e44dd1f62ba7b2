"""The page that holds the thesis's conclusions against its cubes."""
