"""Points from noisy, rounded pixels: posterior means by expectation propagation.

An image coordinate u with Gaussian noise of σ px was rounded to m: it lies in the interval m ± ½
with the probability

    t(u) = Φ((m + ½ − u) / σ) − Φ((m − ½ − u) / σ),

flat over the pixel for little noise, a Gaussian of variance σ² + 1/12 for much. With a flat prior,
the product of all t is the posterior of the point: without noise it is uniform in the polytope of
:mod:`thesis_lib.vision.analytic_centre`; with much noise it is the Gaussian of least squares. Its
maximum is a poor estimate (without noise, the whole polytope). Its mean has the least mean square
error of all estimators whose errors do not depend on the position of the point.

Expectation propagation computes it (Minka 2001). To first order about the least-squares point u is
linear in the point, u = J x, and each t is replaced by a Gaussian exp(−τ u²/2 + ν u), a site. All
sites together have the precision Λ = Σ τ JᵀJ and the mean Λ⁻¹ Σ ν J. Without its own site a
coordinate has a mean M and a variance V. With Z(M, V) the mass of t under this Gaussian,

    Z = Φ(β) − Φ(α),    α, β = (m ∓ ½ − M) / √(V + σ²),
    G = ∂ log Z / ∂M,    H = −∂² log Z / ∂M²,

its product with t has the mean M + V G and the variance V − V² H. The site that gives the same is

    τ = H / (1 − V H),    ν = (G + M H) / (1 − V H).

All sites are updated at once, a few times, with damping. As t is log-concave, 0 ≤ V H < 1.

The noise must be known and the coordinates free of outliers. With σ too small the mean is worse
than least squares, with σ too large it loses part of its gain, and with an outlier the point is
that of least squares; the figure set ``design-law`` tabulates the cost (``mistaken_error``).

Several images of a marker that moves along the world's Z share x and y, so Λ is an arrowhead
matrix.

On a randomly placed grid the pixel's centre has the error e, the sum of the noise and of a rounding
error that is uniform over a pixel. Its density p and the Fisher information are

    p(e) = Φ((e + ½) / σ) − Φ((e − ½) / σ),    I = ∫ p′² / p de  per px².

The covariance of points, averaged over positions of the grids and the points, is at least
(I JᵀJ)⁻¹ (Cramér–Rao bound, in van Trees' form for random unknowns). From σ = 0.3 px on, that of
least squares, (σ² + 1/12) (JᵀJ)⁻¹, is within 2 % of it. For σ → 0 the bound goes to 0 as σ, and no
estimator follows it: pixel faces are then sharp, but few of them are near the point.

Images are ``(cameras, 2, ...)`` in px, points ``(3, ...)`` in m.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask
from thesis_lib.vision import pinhole, triangulation

MIN_NOISE_PX = 1e-3  # least noise that is assumed: it gives the slabs walls of finite thickness
_BLOCK_VALUES = 8000  # camera × point values per block: intermediate results stay in cache
# Over all sites: the mean is then off by some 0.04 of its standard deviation, for 50 to 150 cameras
# at elevations below 10° by 0.06 to 0.13
_MAX_SWEEPS = 5
_DAMPING_RATIO = 0.8  # share of the change to its new value that a site makes in a sweep
_MIN_FREE_PRECISION = 1e-4  # least precision of a coordinate without its site, over that with it
_MAX_SIGMAS = 8.0  # standard deviations from which on a face counts as infinitely far
_MAX_OUTSIDE_SIGMAS = 5.0  # σ that a coordinate may be outside of its pixel
_ROOT_TWO_PI = (2 * np.pi) ** 0.5
# How often each entry of the upper triangle occurs in the symmetric matrix
_ENTRY_COUNTS = np.array([1, 2, 2, 1, 2, 1])[:, None]
_FULL_INDICES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # a matrix from its upper triangle


@dataclass(frozen=True)
class Posterior:
    """Means and covariances of points, and whether their pixels are consistent."""

    #: Posterior means in m, shape (3, ...) or (3, frames, ...); NaN where an image is NaN
    points: Array
    covariance: Array  #: Posterior covariances in m², shape (3, 3, ...) or (3, 3, frames, ...)
    #: Whether all coordinates are within five σ of their pixels, shape (...). Elsewhere, where σ
    #: is too small or the cameras' poses are wrong, points are those of least squares, with its
    #: covariance for rounding and σ.
    feasible: Mask


def interval_estimate(P: ArrayLike, uv: ArrayLike, sigma_px: float = 0.0) -> Posterior:
    """Return the posterior means of points whose noisy images were rounded to whole pixels.

    `P` and `uv` are as for :func:`thesis_lib.vision.analytic_centre.analytic_centre`. `sigma_px`
    is the standard deviation of every image coordinate before rounding, in px; unless it is a
    finite number from 0, a ValueError is raised.
    """
    P, uv = triangulation.check_arrays(P, uv)
    found = joint_interval(P, uv[:, :, None], sigma_px)
    points, covariance = found.points[:, 0], found.covariance[:, :, 0]
    return Posterior(points, covariance, found.feasible)


def joint_interval(P: ArrayLike, uv: ArrayLike, sigma_px: float = 0.0) -> Posterior:
    """Estimate markers that move along Z from several images, with common x and y.

    `uv` is (cameras, 2, frames, ...), such as the pixels at rest and deflected; `points` are then
    (3, frames, ...), `feasible` (...). Where pixels are inconsistent, points are those of least
    squares of each image by itself, and covariances those of least squares with common x and y,
    which are smaller.
    """
    P, uv = triangulation.check_frames(P, uv)
    if not 0 <= sigma_px < np.inf:
        raise ValueError(f"sigma_px: given {sigma_px}, allowed: a number from 0, in px")
    n, frames = len(P), uv.shape[2]
    pixels = uv.reshape(n, 2, frames, -1)
    points = triangulation.triangulate(P, pixels)
    covariance = np.empty((3, 3, *points.shape[1:]))
    feasible = np.empty(points.shape[2], bool)
    block = max(1, _BLOCK_VALUES // (n * frames))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        for first in range(0, len(feasible), block):
            part = slice(first, first + block)
            points[..., part], covariance[..., part], feasible[part] = _block_posterior(
                P, pixels[..., part], points[..., part], float(sigma_px)
            )
    points[:, :, np.isnan(points).any(axis=(0, 1))] = np.nan
    shape = uv.shape[2:]
    points, covariance = points.reshape(3, *shape), covariance.reshape(3, 3, *shape)
    return Posterior(points, covariance, feasible.reshape(shape[1:]))


def _block_posterior(P: Array, pixels: Array, start: Array, sigma: float) -> tuple[Array, ...]:
    """Return a block's points, covariances and feasibility."""
    frames, m = start.shape[1:]
    about = start.copy()
    about[:2] = start[:2].mean(axis=1, keepdims=True)
    J = triangulation.image_jacobian(P, about.reshape(3, -1))
    J = J.reshape(-1, 3, frames * m).swapaxes(0, 1)
    # pixel centres relative to the images of `about`
    middle = (pixels - pinhole.project(P, about)).reshape(J.shape[1:])
    squares = np.stack([J[i] * J[j] for i, j in zip(*triangulation.UPPER_INDICES, strict=True)])
    variance = max(sigma, MIN_NOISE_PX) ** 2
    tau = np.full(middle.shape, 1 / (variance + 1 / 12))
    nu = tau * middle
    x, C, plain = start, start, start
    for sweep in range(_MAX_SWEEPS + 1):
        right = np.einsum("ikm,km->im", J, nu)
        x, C = _solve_sites(np.einsum("akm,km->am", squares, tau), right, frames)
        u = np.einsum("ikm,im->km", J, x)
        if sweep == 0:
            plain = C
        if sweep == _MAX_SWEEPS:
            break
        v = np.einsum("akm,am->km", squares, C * _ENTRY_COUNTS)
        free = np.maximum(1 - tau * v, _MIN_FREE_PRECISION)
        V = v / free
        M = (u - v * nu) / free
        _, G, H = pixel_mass(middle - M, V + variance)
        kept = 1 - V * H
        tau += _DAMPING_RATIO * (H / kept - tau)
        nu += _DAMPING_RATIO * ((G + M * H) / kept - nu)
    outside = np.abs(middle - u).reshape(-1, frames, m).max(axis=(0, 1)) - 0.5
    feasible = outside < _MAX_OUTSIDE_SIGMAS * np.sqrt(variance)
    points = np.where(feasible, about + x.reshape(about.shape), start)
    C = np.where(np.tile(feasible, frames), C, plain)
    return points, C[_FULL_INDICES].reshape(3, 3, frames, m), feasible


def pixel_mass(distance: Array, variance: ArrayLike) -> tuple[Array, Array, Array]:
    """Return log(Φ(β) − Φ(α)), G and H of pixels at distances in px from the mean.

    They are computed in units of φ(α) of the nearer face, so they hold for means far outside, too.
    """
    from scipy.special import erfcx  # late import: other estimators need NumPy alone

    def mills_ratio(x: Array) -> Array:  # (1 − Φ(x)) / φ(x)
        return np.asarray(_ROOT_TWO_PI / 2 * erfcx(x / np.sqrt(2)))

    scale = 1 / np.sqrt(variance)
    off = np.abs(distance) * scale
    alpha, beta = np.maximum(off - scale / 2, -_MAX_SIGMAS), off + scale / 2
    ratio = np.exp((alpha - beta) * (alpha + beta) / 2)  # φ(β) / φ(α)
    near = mills_ratio(np.abs(alpha))
    inside = np.minimum(alpha, 0)
    near = np.where(alpha < 0, _ROOT_TWO_PI * np.exp(inside * inside / 2) - near, near)
    mass = near - ratio * mills_ratio(beta)
    pull = (1 - ratio) / mass
    H = pull * pull - (alpha - beta * ratio) / mass
    log_mass = np.log(mass / _ROOT_TWO_PI) - alpha * alpha / 2
    return log_mass, np.copysign(pull * scale, distance), H * scale * scale


def _solve_sites(precision: Array, right: Array, frames: int) -> tuple[Array, Array]:
    """Return means (3, frames × m) and covariances (6, frames × m).

    Eliminating z of every frame from the arrowhead matrix leaves a 2×2 system for x and y, which
    all frames share.
    """
    xx, xy, xz, yy, yz, zz = precision.reshape(6, frames, -1)
    hx, hy, hz = right.reshape(3, frames, -1)
    fx, fy = xz / zz, yz / zz
    a, b, d = (np.sum(part, axis=0) for part in (xx - fx * xz, xy - fx * yz, yy - fy * yz))
    p, q = np.sum(hx - fx * hz, axis=0), np.sum(hy - fy * hz, axis=0)
    det = a * d - b * b
    cxx, cxy, cyy = d / det, -b / det, a / det
    x, y = cxx * p + cxy * q, cxy * p + cyy * q
    cxz, cyz = -(cxx * fx + cxy * fy), -(cxy * fx + cyy * fy)
    czz = 1 / zz - cxz * fx - cyz * fy
    mean = np.broadcast_arrays(x, y, hz / zz - fx * x - fy * y)
    shared = np.broadcast_arrays(cxx, cxy, cxz, cyy, cyz, czz)
    return np.stack(mean).reshape(3, -1), np.stack(shared).reshape(6, -1)


MAX_NOISE_PX = 1.0  # largest noise that is searched
_SIGMA_STEPS = 16  # steps of the integral per σ, or per half a pixel if that is less
_REACH_SIGMAS = 10  # σ beyond a pixel's faces, where the integral ends
# Fall of the log-likelihood at the ends of a 95 % interval
_LIKELIHOOD_FALL = 1.92
_SAMPLED_IMAGES = 800  # of the samples of a point: the more cameras, the fewer samples it needs
_MIN_SAMPLES = 50
_WIDENING = 1.15  # of the samples over the posterior, so that their tails are longer


def pixel_information(sigma_px: float) -> float:
    """Return the Fisher information in 1/px² of a noisy coordinate rounded to pixels.

    Raises
    ------
    ValueError
        If σ is not above 0: without noise there is no limit.
    """
    if not 0 < sigma_px < np.inf:
        raise ValueError(f"sigma_px: given {sigma_px}, allowed: a number above 0, in px")
    step = min(sigma_px / _SIGMA_STEPS, 0.5 / _SIGMA_STEPS)
    number = np.ceil((0.5 + _REACH_SIGMAS * sigma_px) / step)
    log_p, slope, _ = pixel_mass(step * np.arange(-number, number + 1), sigma_px**2)
    return float(np.sum(slope**2 * np.exp(log_p)) * step)


def least_covariance(P: ArrayLike, points: ArrayLike, sigma_px: float) -> Array:
    """Return the lower bound (3, 3, ...) in m² of the covariance of any estimate of points.

    The bound of a deflection is the sum of those at rest and deflected; `points` are (3, ...).
    """
    return triangulation.point_covariance(P, points, pixel_information(sigma_px) ** -0.5)


@dataclass(frozen=True)
class Noise:
    """Pixel noise in px: the most likely value, and the ends of its 95 % interval."""

    best: float
    least: float
    most: float


def estimate_noise(P: ArrayLike, uv: ArrayLike) -> Noise:
    """Estimate the noise of images before rounding from their inconsistency.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, ...)
        Centres of the pixels in px, of hundreds of points; points with NaN are left out.

    Returns
    -------
    Noise
        From the likelihood of σ from 0 to 1 px, with ∫ ∏ t of every point by importance sampling.
        Errors of the cameras count as noise. A pair of cameras gives little information, as each
        point has only one redundant coordinate: for few points, `least` is 0 and `most` is large.
        A thousand points take some three seconds.

    Raises
    ------
    ValueError
        If there are fewer than two cameras, shapes do not match, or all points have a NaN.
    """
    import scipy.optimize  # late import: other estimators need NumPy alone

    P, images = np.asarray(P, float), np.asarray(uv, float)
    images = images.reshape(*images.shape[:2], -1)
    images = images[:, :, np.isfinite(images).all(axis=(0, 1))]
    if images.shape[2] == 0:
        raise ValueError("uv: given no point that all cameras see, needs 1 or more")

    tolerance = MIN_NOISE_PX / 2
    found = scipy.optimize.minimize_scalar(
        lambda sigma: -_log_likelihood(P, images, sigma),
        bounds=(0, MAX_NOISE_PX),
        options={"xatol": tolerance},
    )

    def excess(sigma: float) -> float:
        """Return the log-likelihood over that at the ends of the interval."""
        return _log_likelihood(P, images, sigma) + float(found.fun) + _LIKELIHOOD_FALL

    least, most = (
        end if excess(end) > 0 else scipy.optimize.brentq(excess, found.x, end, xtol=tolerance)
        for end in (0.0, MAX_NOISE_PX)
    )
    return Noise(float(found.x), float(least), float(most))


def _log_likelihood(P: Array, images: Array, sigma_px: float) -> float:
    """Return the sum over points of log ∫ ∏ t, but for a constant, by importance sampling.

    Samples are about the posterior means, with the same random numbers for all σ. The logarithm of
    a mean of n weights is on average too small by half of their relative variance over n, which is
    corrected.
    """
    from scipy.special import ndtr  # late import, as above

    sigma = max(sigma_px, MIN_NOISE_PX)
    posterior = interval_estimate(P, images, sigma)
    roots = _WIDENING * np.linalg.cholesky(np.moveaxis(posterior.covariance, 2, 0))
    n = max(_MIN_SAMPLES, _SAMPLED_IMAGES // len(P))
    random, total = np.random.default_rng(0), 0.0
    for part in np.array_split(np.arange(len(roots)), -(-len(roots) * n // _BLOCK_VALUES)):
        steps = random.standard_normal((len(part), 3, n))
        points = posterior.points[:, part, None] + (roots[part] @ steps).swapaxes(0, 1)
        off = np.abs(pinhole.project(P, points) - images[:, :, part, None])
        mass = np.prod(ndtr((0.5 - off) / sigma) - ndtr((-0.5 - off) / sigma), axis=(0, 1))
        weights = mass * np.exp(np.sum(steps * steps, axis=1) / 2) + 1e-300  # finite logarithms
        mean = weights.mean(axis=1)
        bias = np.var(weights / mean[:, None], axis=1) / (2 * n)
        total += float(np.sum(np.log(mean * np.linalg.det(roots[part])) + bias))
    return total
