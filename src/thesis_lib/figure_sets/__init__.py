"""Figure sets: one folder for each family, and the modules that they share."""
