"""Poles that all cameras share: damped sinusoids by variable projection.

A track is a sum of e^{λt}, λ = −α + jω, at the times of its own camera. The poles are common to all
tracks of all cameras, while every track has amplitudes of its own. For given poles these follow by
linear least squares; what is left of the tracks depends on the poles alone (Golub and Pereyra 1973)
and is made least by Gauss–Newton steps with Kaufman's derivative (1975). Frames at any times, rates
that differ, and frequencies above half of a rate need nothing more. A rolling shutter or an
exposure changes amplitudes, not poles.

Tracks of many markers span few dimensions, two for a mode: before the fit each camera's are turned
into their principal series, which changes nothing but the time it takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from thesis_lib.arrays import Array, Mask

SERIES = 16  # principal series of a camera that are kept, at least
SINGULAR = 1e12  # condition of the columns over some frames, from which on these do not tell
TOLERANCE = 1e-12  # relative change of the sum of squares at which the fit ends


@dataclass(frozen=True)
class Block:
    """The tracks of one camera over the noise of each, about their means."""

    times: Array  #: From the begin of the part that is fitted, s, shape (frames,)
    values: Array  #: Over `scale`, shape (frames, series); what was missing is filled
    known: Mask  #: What was seen, shape (frames, series)
    principal: Array  #: What the fit uses of the values, shape (frames, few)
    scale: Array  #: Noise of each series, shape (series,)


@dataclass(frozen=True)
class Poles:
    """A set of poles, as fitted."""

    rates: Array  #: Decay α (1/s) and angular frequency ω (rad/s) of each, shape (modes, 2)
    covariance: Array  #: Of all these in this order, shape (2 modes, 2 modes); zero if not fitted
    each: Array  #: What each camera alone would change of them, (cameras, 2 modes)
    each_deviation: Array  #: Standard deviations of that, by the noise of the tracks
    noise: float  #: Standard deviation of what is left, in units of the blocks' values

    @property
    def frequency(self) -> Array:
        """Natural frequencies |λ| / 2π in Hz, shape (modes,)."""
        return np.asarray(np.hypot(*self.rates.T) / (2 * np.pi), float)

    @property
    def damping(self) -> Array:
        """Damping ratios α / |λ|, shape (modes,)."""
        return np.asarray(self.rates[:, 0] / np.hypot(*self.rates.T), float)

    @property
    def deviations(self) -> tuple[Array, Array]:
        """Standard errors of :attr:`frequency` and :attr:`damping`."""
        alpha, omega = self.rates.T
        size = np.hypot(alpha, omega)
        k = 2 * np.arange(len(alpha))
        own = self.covariance[k[:, None, None] + [[0], [1]], k[:, None, None] + [[0, 1]]]
        along = np.stack([alpha, omega], axis=1) / (2 * np.pi * size[:, None])
        turning = np.stack([omega**2, -alpha * omega], axis=1) / size[:, None] ** 3
        found = [np.sqrt(np.einsum("ki,kij,kj->k", g, own, g)) for g in (along, turning)]
        return found[0], found[1]


def block_of(times: Array, values: Array, scale: Array, series: int = SERIES) -> Block:
    """Values (frames, series) over their noise, at times from 0 on; NaN is filled with a mean."""
    known = np.isfinite(values) & np.isfinite(scale)
    over = np.where(known, values, 0.0) / np.where(np.isfinite(scale), scale, 1.0)
    mean = over.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    about = np.where(known, over - mean, 0.0)
    return Block(times, about, known, principal(about, series), scale)


def principal(values: Array, series: int) -> Array:
    """The strongest principal series of values (frames, n), at most so many."""
    _, turn = np.linalg.eigh(values.T @ values)
    return np.asarray(values @ turn[:, ::-1][:, :series], float)


def filled(block: Block, rates: Array, series: int = SERIES) -> Block:
    """The block with the fit in place of what is missing."""
    if block.known.all():
        return block
    B = columns(block.times, rates)
    values = np.where(block.known, block.values, B @ seen_fit(B, block)[0])
    return replace(block, values=values, principal=principal(values, series))


def seen_fit(B: Array, block: Block) -> tuple[Array, Array]:
    """Coefficients of columns by what is seen, (n, series), and covariances for a noise of one.

    The latter have shape (series, n, n), and are infinite where too little is seen.
    """
    n, known = B.shape[1], block.known
    if known.all():
        alike = np.linalg.inv(B.T @ B)
        return coefficients(B, block.values), np.broadcast_to(alike, (known.shape[1], n, n))
    matrix = np.einsum("ti,tj,ts->sij", B, B, known.astype(float), optimize=True)
    enough = (known.sum(axis=0) >= n + 2) & (np.linalg.cond(matrix) < SINGULAR)
    inverse = np.linalg.inv(np.where(enough[:, None, None], matrix, np.eye(n)))
    right = B.T @ np.where(known, block.values, 0.0)
    found = np.where(enough, np.einsum("sij,js->is", inverse, right), 0.0)
    return found, np.where(enough[:, None, None], inverse, np.inf)


def scatter(block: Block, B: Array, fit: Array) -> Array:
    """Scatter of each series about a fit of columns, px; NaN of one that is hardly seen."""
    left = np.where(block.known, block.values - B @ fit, 0.0)
    freedom = block.known.sum(axis=0) - B.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.sum(left**2, axis=0) / freedom)
    return np.asarray(np.where(freedom >= 2, sigma, np.nan) * block.scale, float)


def columns(times: Array, rates: Array) -> Array:
    """A constant, then e^{−αt} cos ωt and e^{−αt} sin ωt of each pole, (times, 1 + 2 modes)."""
    made = [np.ones_like(times)]
    for alpha, omega in rates:
        decay = np.exp(-alpha * times)
        made += [decay * np.cos(omega * times), decay * np.sin(omega * times)]
    return np.stack(made, axis=1)


def coefficients(B: Array, values: Array) -> Array:
    """Least-squares coefficients of columns (times, n) for values (times, series), (n, series)."""
    Q, R = np.linalg.qr(B)
    return np.asarray(np.linalg.solve(R, Q.T @ values), float)


def left_of(block: Block, rates: Array) -> Array:
    """What is left of the principal series beside the poles, shape (frames, few)."""
    Q, _ = np.linalg.qr(columns(block.times, rates))
    return np.asarray(block.principal - Q @ (Q.T @ block.principal), float)


def fitted(blocks: Sequence[Block], start: Array, damped: bool) -> Poles:
    """Poles from a start (modes, 2); without damping only the frequencies are fitted."""
    free = np.ones_like(start, bool)
    free[:, 0] = damped
    scale = 1 / max(float(np.ptp(block.times)) for block in blocks)

    def rates(x: Array) -> Array:
        full = start.copy()
        full[free] += x * scale
        return full

    def residual(x: Array) -> Array:
        return np.concatenate([left_of(block, rates(x)).ravel() for block in blocks])

    def derivative(x: Array) -> Array:
        return np.concatenate([_slopes(block, rates(x), free) for block in blocks]) * scale

    found = least_squares(residual, np.zeros(free.sum()), derivative, method="lm", ftol=TOLERANCE)
    best = rates(found.x)
    J = [_slopes(block, best, free) for block in blocks]
    square = [own.T @ own for own in J]
    noise = _noise(blocks, best)
    each = [
        -np.linalg.lstsq(s, own.T @ left_of(block, best).ravel(), rcond=None)[0]
        for s, own, block in zip(square, J, blocks, strict=True)
    ]
    spread = [noise * np.sqrt(np.maximum(np.diag(np.linalg.pinv(s)), 0)) for s in square]
    index = np.flatnonzero(free.ravel())
    covariance = np.zeros((free.size, free.size))
    covariance[np.ix_(index, index)] = noise**2 * np.linalg.pinv(sum(square))
    wide = np.zeros((2, len(blocks), free.size))
    wide[:, :, index] = each, spread
    return Poles(best, covariance, wide[0], wide[1], noise)


def _slopes(block: Block, rates: Array, free: Mask) -> Array:
    """Kaufman's derivative of what is left by the rates that are free, (values, free)."""
    B = columns(block.times, rates)
    Q, R = np.linalg.qr(B)
    C = np.linalg.solve(R, Q.T @ block.principal)
    made = []
    for k in range(len(rates)):
        both = B[:, 2 * k + 1 : 2 * k + 3] * block.times[:, None]
        cosine, sine = C[2 * k + 1 : 2 * k + 3]
        by_decay = -both @ np.stack([cosine, sine])
        by_turn = both @ np.stack([sine, -cosine])
        for j, d in enumerate((by_decay, by_turn)):
            if free[k, j]:
                made.append(-(d - Q @ (Q.T @ d)).ravel())
    return np.stack(made, axis=1)


def _noise(blocks: Sequence[Block], rates: Array) -> float:
    """Standard deviation of what is left of all tracks, not only of the principal series."""
    squares, freedom = 0.0, 0
    for block in blocks:
        Q, _ = np.linalg.qr(columns(block.times, rates))
        left = np.where(block.known, block.values - Q @ (Q.T @ block.values), 0.0)
        squares += float(np.sum(left**2))
        freedom += int(block.known.sum()) - Q.shape[1] * block.values.shape[1]
    return float(np.sqrt(squares / max(freedom, 1)))
