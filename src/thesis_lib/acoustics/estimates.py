"""Sound of a measured vibration: values and their standard errors.

A measurement gives complex amplitudes ŵ = w + e with Gaussian errors e of mean 0. Stack real and
imaginary parts, x = (Re w, Im w), and let Σ be the covariance of x̂. A pressure is linear in w; a
power is a quadratic form xᵀAx. The form of measured amplitudes has

    E x̂ᵀAx̂ = xᵀAx + tr AΣ,    Var x̂ᵀAx̂ = 4 xᵀAΣAx + 2 tr AΣAΣ

exactly. The errors' own power tr AΣ is therefore subtracted. As x̂ in place of x makes the first
term of the variance too large by 4 tr AΣAΣ, that is subtracted, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray


@dataclass(frozen=True)
class Estimate:
    """Numbers with their standard errors, both of one shape."""

    value: Array
    error: Array


@dataclass(frozen=True)
class Amplitudes:
    """Measured complex amplitudes, and the covariance of their errors."""

    value: ComplexArray  #: Shape (n,)
    covariance: Array  #: Of the real parts, then the imaginary parts, shape (2n, 2n)

    @property
    def stacked(self) -> Array:
        """Return the real parts, then imaginary parts, shape (2n,)."""
        return np.concatenate([self.value.real, self.value.imag])

    def part(self, places: IntArray) -> Amplitudes:
        """Return the amplitudes at some indices."""
        both = np.concatenate([places, len(self.value) + places])
        return Amplitudes(self.value[places], self.covariance[np.ix_(both, both)])


def stack_matrix(matrix: ArrayLike) -> Array:
    """Return the real (2m, 2n) matrix that applies a complex (m, n) one to stacked parts."""
    M = np.asarray(matrix)
    return np.block([[M.real, -M.imag], [M.imag, M.real]])


def circular_estimate(
    value: ArrayLike, variance: ArrayLike, common: ArrayLike | None = None
) -> Amplitudes:
    """Return amplitudes with equal variances of both parts, independent but for common errors.

    Parameters
    ----------
    value : array_like, shape (n,)
        Complex amplitudes.
    variance : array_like, shape (n,)
        Variance of each real part, and of each imaginary part.
    common : array_like, shape (k, n), optional
        Complex: each row is the effect on all amplitudes of one error of standard deviation 1,
        independent of the others, such as a calibration error.
    """
    whole = np.diag(np.tile(np.asarray(variance, float), 2))
    if common is not None:
        rows = np.asarray(common)
        both = np.concatenate([rows.real, rows.imag], axis=1)
        whole = whole + both.T @ both
    return Amplitudes(np.asarray(value, complex), whole)


def estimate_quadratic_form(form: ArrayLike, of: Amplitudes) -> Estimate:
    """Estimate the form wᴴAw for a real symmetric A (n, n), less the power of errors."""
    A = np.kron(np.eye(2), np.asarray(form, float))
    AS, x = A @ of.covariance, of.stacked
    value = float(x @ A @ x - np.trace(AS))
    return Estimate(np.array(value), np.sqrt(_form_variance(A, of)))


def estimate_squares(rows: ArrayLike, of: Amplitudes) -> Estimate:
    """Estimate each form |rₖ·w|² of real or complex rows (k, n), less the power of errors."""
    at, S = _row_products(rows, of)
    value = np.sum(at**2, axis=0) - np.trace(S, axis1=1, axis2=2)
    own = np.sum(S * S.swapaxes(1, 2), axis=(1, 2))
    variance = 4 * np.einsum("ak,kab,bk->k", at, S, at) - 2 * own
    return Estimate(value, np.sqrt(np.maximum(variance, 2 * own)))


def estimate_sum(rows: ArrayLike, of: Amplitudes) -> Estimate:
    """Estimate the sum of |rₖ·w|² over real or complex rows (k, n), less the power of errors."""
    R = stack_matrix(rows)
    at, S = R @ of.stacked, R @ of.covariance @ R.T
    own = float(np.sum(S * S.T))
    variance = max(4 * float(at @ S @ at) - 2 * own, 2 * own)
    return Estimate(np.array(at @ at - np.trace(S)), np.sqrt(variance))


def estimate_ratio(above: ArrayLike, below: ArrayLike, of: Amplitudes) -> Estimate:
    """Return the quotient of two forms wᴴAw / wᴴBw, to the first order of their errors."""
    A, B = (np.kron(np.eye(2), np.asarray(form, float)) for form in (above, below))
    a, b = (float(estimate_quadratic_form(form, of).value) for form in (above, below))
    value = a / b
    D = A - value * B  # the quotient has the error of this form over b
    return Estimate(np.array(value), np.sqrt(_form_variance(D, of)) / abs(b))


def widen_error(of: Estimate, relative: float) -> Estimate:
    """Return an estimate with an independent relative standard error added to its own."""
    return Estimate(of.value, np.hypot(of.error, relative * of.value))


def estimate_magnitude(rows: ArrayLike, of: Amplitudes) -> Estimate:
    """Estimate |rₖ·w|, less the power of errors in its square; 0 where that exceeds the square."""
    at, S = _row_products(rows, of)
    square = np.sum(at**2, axis=0) - np.trace(S, axis1=1, axis2=2)
    along = at / np.maximum(np.hypot(*at), np.finfo(float).tiny)
    variance = np.einsum("ak,kab,bk->k", along, S, along)
    return Estimate(np.sqrt(np.maximum(square, 0)), np.sqrt(np.maximum(variance, 0)))


def _row_products(rows: ArrayLike, of: Amplitudes) -> tuple[Array, Array]:
    """Return the real and imaginary parts of rₖ·w, (2, k), and their covariances, (k, 2, 2)."""
    parts = np.stack(np.split(stack_matrix(rows), 2))  # (2, k, 2n)
    spread = (parts.reshape(-1, parts.shape[2]) @ of.covariance).reshape(parts.shape)
    return parts @ of.stacked, np.einsum("akn,bkn->kab", spread, parts, optimize=True)


def _form_variance(A: Array, of: Amplitudes) -> Array:
    """Estimate a form's variance, at least that of errors alone."""
    AS, x = A @ of.covariance, of.stacked
    own = float(np.sum(AS * AS.T))
    slopes = float(x @ AS @ A @ x)
    return np.array(max(4 * slopes - 2 * own, 2 * own))
