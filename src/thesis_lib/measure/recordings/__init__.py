"""Inputs of a measurement: manifest, videos, audio, markers and calibration board."""
