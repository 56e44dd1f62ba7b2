"""One folder for each family of figure sets, and what is common to them."""
