"""What the calibration's errors do to all markers alike."""

import numpy as np

from thesis_lib.measure.fitting import calibration_error


def test_fewer_rows_keep_what_sizes_and_phases_do_together():
    """An error of all sizes alike stays one of sizes, with no share that turns phases.

    Real and imaginary parts of what the rows draw have the covariance that draws of the rows have.
    """
    rng = np.random.default_rng(3)
    shape = rng.standard_normal(20) * np.exp(0.1j * rng.standard_normal(20))
    scale = np.outer(rng.standard_normal(12), shape)  # each turns nothing
    turn = 1e-3j * np.outer(rng.standard_normal(12), np.ones(20))
    rows = np.concatenate([scale, turn])
    fewer = calibration_error._fewer(rows)
    assert len(fewer) <= calibration_error.MAX_DIRECTIONS
    drawn = [rng.standard_normal((200_000, len(each))) @ each for each in (rows, fewer)]
    parts = [np.concatenate([each.real, each.imag], axis=1) for each in drawn]
    before, after = (np.cov(each.T) for each in parts)
    spread = np.sqrt(np.outer(np.diag(before), np.diag(before)))
    assert np.abs(after - before).max() < 0.02 * spread.max()
    turned = [np.std((each / shape).imag, axis=0) for each in drawn]
    np.testing.assert_allclose(turned[1], turned[0], rtol=0.02)
