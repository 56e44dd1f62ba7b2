"""Execution of requests: set-up of the process, notebooks, cubes and pages."""
