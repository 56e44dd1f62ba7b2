"""Flexural vibration measured by several cameras: the library of an executable thesis companion.

The physics is in :mod:`~thesis_lib.structures`, :mod:`~thesis_lib.cameras`,
:mod:`~thesis_lib.triangulation`, :mod:`~thesis_lib.rounding`, :mod:`~thesis_lib.radiation` and
:mod:`~thesis_lib.planes`; they need NumPy alone.
:mod:`~thesis_lib.setups` holds the thesis's camera setups, :mod:`~thesis_lib.studies` turns them
into labelled cubes, and :mod:`~thesis_lib.claims` holds those against the thesis.
"""

__version__ = "0.1.0"
