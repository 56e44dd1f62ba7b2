"""Flexural vibration measured by several cameras: the library of an executable thesis companion.

The physics is in :mod:`~thesis_lib.vibration.structure`, :mod:`~thesis_lib.vision.pinhole`,
:mod:`~thesis_lib.vision.triangulation`, :mod:`~thesis_lib.vision.rounding`,
:mod:`~thesis_lib.acoustics.radiation` and :mod:`~thesis_lib.acoustics.planes`; they need NumPy
alone. :mod:`~thesis_lib.facts.setups` holds the thesis's camera setups,
:mod:`~thesis_lib.figure_sets.parametric.compute` turns them into labelled cubes, and
:mod:`~thesis_lib.ledger.verdicts` holds those against the thesis.
"""

__version__ = "1.0.0"
