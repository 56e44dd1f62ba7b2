"""Receptance by averaged spectra: H1, H2, Hv, coherence and standard errors.

Of segments of force F and motion X, with ⟨⟩ their mean: H1 = ⟨XF*⟩ / ⟨FF*⟩, which noise in the
motion leaves right and noise in the force makes too small; H2 = ⟨XX*⟩ / ⟨FX*⟩, which noise in the
force leaves right and noise in the motion makes too large; Hv, between them, has the size
√(⟨XX*⟩ / ⟨FF*⟩). The coherence γ² = H1 / H2 is the share of the motion that the force explains
(Bendat and Piersol, Random Data, chapters 6 and 9).

Over n independent segments, H1 is a regression: the variance of either part, relative to |H1|², is
v = (1 − γ²) / (2 (n − 1) γ²). H2 is the inverse of the regression of the force on the motion, so v
relative to |H2|², which is larger. The phase of Hv is theirs, its size varies by γ² v only: on
average over both parts it is (1 + γ²) v / 2. These are variances about what each estimator tends
to, noise's share of it included.

The spectrum of a Hann window adds a sixth of each line's power to either neighbour, which blurs
narrow resonances. That can be undone in estimates, though only roughly and at the cost of noise: it
tells by how much they are blurred.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded
from scipy.signal import ShortTimeFFT, get_window
from scipy.sparse import diags_array

from thesis_lib.arrays import Array, ComplexArray

ESTIMATORS = ("H1", "H2", "Hv")
HANN_SHARE = 1 / 6  # of a line's power that a Hann window adds to each neighbour
#: Square of a blur that is estimated where there is only noise, over the variance of either part of
#: the receptance: twice the mean of (1 − 1/k)² S over all θ, with k = 2/3 + cos θ / 3 of the window
#: and S = 1 + 8/9 cos θ + cos 2θ / 18 of the noise of lines that overlap
BLUR_BY_NOISE = 0.62


@dataclass(frozen=True)
class Cut:
    """How a recording is cut into segments."""

    rate: float  #: Samples per second of the motion, Hz
    length: int  #: Samples of it in a segment, even
    count: int  #: Segments; more than one overlap by half, and have a Hann window

    @property
    def window(self) -> str:
        """Name of the window: a whole recording begins and ends at rest, and needs none."""
        return "hann" if self.count > 1 else "boxcar"

    @property
    def averages(self) -> float:
        """Return the number of independent segments with the same information (Welch 1967)."""
        w = get_window(self.window, self.length)
        like = float(np.sum(w[self.length // 2 :] * w[: self.length // 2]) / np.sum(w**2)) ** 2
        return self.count / (1 + 2 * (1 - 1 / self.count) * like)


def cut_of(samples: int, rate: float, seconds: float | None) -> Cut:
    """Return the segments of at most so many seconds; None takes the whole as one."""
    whole = samples // 2 * 2
    length = whole if seconds is None else max(min(round(seconds * rate / 2) * 2, whole), 4)
    return Cut(rate, length, 1 + (samples - length) // (length // 2) if length < whole else 1)


def segment_spectra(values: Array, cut: Cut, finer: int = 1) -> ComplexArray:
    """Return spectra of segments of (samples · finer, series): (lines, segments, series).

    `finer` samples stand for one of the motion's: lines are the same for all. Amplitudes are those
    of densities, so that a mean of squares is a power in units²/Hz.
    """
    length = cut.length * finer
    window = get_window(cut.window, length)
    made = ShortTimeFFT(window, length // 2, cut.rate * finer, scale_to="psd")
    first = -(-length // 2 // made.hop)  # the first slice that is inside, and its middle
    found = made.stft_detrend(values, "constant", p0=first, p1=first + cut.count, axis=0)
    lines = cut.length // 2 + 1
    one_sided = np.sqrt(2)
    return np.asarray(one_sided * np.moveaxis(found[:lines], -1, 1), complex)


@dataclass(frozen=True)
class Response:
    """Motion over force of every marker."""

    frequency: Array  #: Hz, shape (lines,)
    receptance: ComplexArray  #: By H1, H2, Hv, m/N, shape (3, markers, lines)
    coherence: Array  #: Shape (markers, lines); one throughout where there is one segment
    #: Standard error of real and of imaginary part, m/N, as `receptance`; it holds `blur`
    deviation: Array
    blur: Array  #: Size of the error by the segments' resolution, m/N, as `receptance`
    force: Array  #: Power of the force, N²/Hz, shape (lines,)
    averages: Array  #: Independent segments of each marker, shape (markers,)


def receptance_of_segments(
    force: ComplexArray, moved: ComplexArray, cut: Cut, noise: Array
) -> Response:
    """Return the receptance from spectra of segments.

    Parameters
    ----------
    force : ndarray, shape (lines, segments)
        Of the force, N/√Hz.
    moved : ndarray, shape (lines, segments, markers)
        Of the motion, m/√Hz; NaN in segments in which a marker is lost.
    cut : Cut
        How they were made.
    noise : ndarray, shape (markers,) or (lines, markers)
        Power of the noise in the motion, m²/Hz, from which one segment has its error.
    """
    known = np.isfinite(moved).all(axis=0)  # (segments, markers)
    X = np.where(known, moved, 0.0)
    count = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ff = (np.abs(force) ** 2) @ (known / count)
        xx = np.sum(np.abs(X) ** 2, axis=1) / count
        xf = np.sum(X * force.conj()[:, :, None], axis=1) / count
        coherence = np.minimum(np.abs(xf) ** 2 / (ff * xx), 1.0)
        first = xf / ff
        whole = np.array([first, xx / xf.conj(), first / np.sqrt(coherence)])
        averages = cut.averages * count / cut.count
        relative = np.tile((1 - coherence) / (2 * (averages - 1) * coherence), (3, 1, 1))
        relative[2] *= (1 + coherence) / 2
        alone = noise / (2 * ff * averages)
        scatter = np.where(count > 1, relative * np.abs(whole) ** 2, alone)
    blur = np.zeros(whole.shape)
    if cut.count > 1:
        squares = np.abs(estimate_blur(first)) ** 2 - BLUR_BY_NOISE * scatter
        blur = np.sqrt(np.maximum(squares, 0))
    error = np.hypot(np.sqrt(scatter), blur)
    return Response(
        np.arange(len(force)) * cut.rate / cut.length,
        whole.transpose(0, 2, 1),
        coherence.T,
        error.transpose(0, 2, 1),
        blur.transpose(0, 2, 1),
        np.mean(np.abs(force) ** 2, axis=1),
        averages,
    )


def estimate_blur(receptance: ComplexArray) -> ComplexArray:
    """Estimate by how much segments with a Hann window blur H1, H2 and Hv, (3, lines, markers).

    From H1, (lines, markers), the receptance is sharpened, and from that it is computed what the
    window makes of each estimator, for a force whose power is even.
    """
    lines = len(receptance)
    bands = np.tile([[HANN_SHARE], [1 - 2 * HANN_SHARE], [HANN_SHARE]], lines)
    bands[1, [0, -1]] += HANN_SHARE
    blur = diags_array([bands[0, 1:], bands[1], bands[2, 1:]], offsets=[-1, 0, 1])
    sharp = solve_banded((1, 1), bands, receptance, check_finite=False)
    power = blur @ np.abs(sharp) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        second = power / receptance.conj()
    return (
        np.array([receptance, second, np.sqrt(power) * np.exp(1j * np.angle(receptance))]) - sharp
    )
