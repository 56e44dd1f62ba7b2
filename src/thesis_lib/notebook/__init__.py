"""Functions for notebooks: validation of parameters, display of results, controls."""
