"""Panels, maps, numbers and viewer data of any cube."""
