"""Points from whole pixels: the analytic centre of the polytope that the pixels allow.

A coordinate that was rounded to m bounds the point to a slab, m − ½ ≤ u ≤ m + ½. In front of the
camera both faces are linear in the point: with p_k the rows of P and X homogeneous,

    s_lo = (p₁ − (m − ½) p₃) X ≥ 0,    s_hi = ((m + ½) p₃ − p₁) X ≥ 0.

All slabs together are a convex polytope. Least squares may give a point outside it; here the
point is its analytic centre, arg max Σ log s, by Newton's method on all points at once. The start
is the least-squares point: a slack that is too small there is widened by τe, and a step of length
α reduces τ to (1 − α) τ (infeasible-start Newton; Boyd and Vandenberghe, *Convex Optimization*,
10.3). With N cameras errors fall about as 1/N, those of least squares as 1/√N. A camera that is
listed twice does not change the polytope, but counts twice in its centre.

Several images of one marker that moves along the world's Z share x and y. Each adds its slabs and
one z, so the Hessian is an arrowhead matrix, solved by eliminating every z first.

Images are ``(cameras, 2, ...)`` in px, points ``(3, ...)`` in m.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask
from thesis_lib.vision import triangulation

# Camera × point values per block: intermediate results stay in the 1 MB cache of a processor core.
_BLOCK_VALUES = 18000
# Newton steps after which a polytope counts as empty: all of 144,249 feasible ones took at most 25.
_MAX_STEPS = 30
_MARGIN_RATIO = 0.1  # least distance of the start from a slab's faces over the slab's width
# A step with a Newton decrement below this is the last: the error after it is about the square
_MAX_CENTRED_DECREMENT = 1e-5
# Share of converged points at which they are taken out of the arrays: copying costs time, too
_MIN_FINISHED_SHARE = 0.25
_MAX_QUADRATIC_DECREMENT = 0.25  # Newton decrement below which full steps converge


@dataclass(frozen=True)
class Centres:
    """Estimated points, and whether their slabs have a common interior."""

    #: Analytic centres in m; least-squares points where the polytope is empty; NaN where an image
    #: is NaN, shape (3, ...)
    points: Array
    feasible: Mask  #: Whether the point is an analytic centre, shape (...)


def analytic_centre(P: ArrayLike, uv: ArrayLike) -> Centres:
    """Return the analytic centres of the polytopes that rounded images (cameras, 2, ...) allow.

    The result is that of :func:`joint_centre` for one frame of every point.
    """
    P, uv = triangulation.check_arrays(P, uv)
    found = joint_centre(P, uv[:, :, None])
    return Centres(found.points[:, 0], found.feasible)


def joint_centre(P: ArrayLike, uv: ArrayLike) -> Centres:
    """Return the analytic centres for several images of markers that move along Z: common x and y.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, frames, ...)
        Centres of the slabs in px, such as those at rest and those deflected: rounded image
        coordinates, less the shift of the grid on which they were rounded. NaN in any camera or
        frame gives NaN.

    Returns
    -------
    Centres
        Points (3, frames, ...), whose x and y agree between frames, and `feasible` (...). Where
        the slabs have no common interior (wrong cameras, noise, a point on a face), the points are
        those of :func:`thesis_lib.vision.triangulation.triangulate` for each frame alone.

    Raises
    ------
    ValueError
        If fewer than two cameras are given, or the shapes do not match.
    """
    P, uv = triangulation.check_frames(P, uv)
    start = triangulation.triangulate(P, uv)
    n, frames = len(P), uv.shape[2]
    slabs = _Slabs(P)
    pixels = uv.reshape(n, 2, frames, -1)
    points = start.reshape(3, frames, -1).copy()
    feasible = np.zeros(pixels.shape[3], bool)
    block = max(1, _BLOCK_VALUES // (n * frames))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for first in range(0, len(feasible), block):
            part = slice(first, first + block)
            slabs.centre(pixels[..., part], points[..., part], feasible[part])
    points[:, :, np.isnan(points).any(axis=(0, 1))] = np.nan
    return Centres(points.reshape(start.shape), feasible.reshape(uv.shape[3:]))


class _Slabs:
    """Constant matrices of the log-barrier function of a set of cameras.

    With α = 1/s_lo², β = 1/s_hi², a_k the first three entries of row k of P and lo, hi the faces,
    the Hessian of one coordinate is
    (α + β) a₁a₁ᵀ − (lo α + hi β)(a₁a₃ᵀ + a₃a₁ᵀ) + (lo² α + hi² β) a₃a₃ᵀ: linear in five numbers
    per camera, as the gradient of Σ log s is in three.
    """

    def __init__(self, P: Array) -> None:
        P, self.middle = triangulation.centre_projections(P)
        self.rows = np.concatenate([P[:, 0], P[:, 1], P[:, 2]])
        a = P[:, :, :3]
        i, j = triangulation.UPPER_INDICES
        outer = np.einsum("nik,njl->nijkl", a, a)[..., i, j]
        turned = -(outer + outer.swapaxes(1, 2))
        parts = [outer[:, 0, 0], outer[:, 1, 1], turned[:, 0, 2], turned[:, 1, 2], outer[:, 2, 2]]
        self.hessian = np.concatenate(parts).T.copy()
        self.gradient = np.concatenate([a[:, 0], a[:, 1], -a[:, 2]]).T.copy()

    def slacks(self, edges: Array, x: Array) -> Array:
        """Return slacks s (lo and hi, u and v, cameras, points) in px·m at points (3, points)."""
        n = len(self.rows) // 3
        image = self.rows[:, :3] @ x
        image += self.rows[:, 3:]
        s: Array = edges * image[2 * n :]
        np.subtract(image[: 2 * n].reshape(2, n, -1), s[0], out=s[0])
        s[1] -= image[: 2 * n].reshape(2, n, -1)
        return s

    def newton(self, edges: Array, s: Array, wanted: Array) -> tuple[Array, Array]:
        """Return hessian (6, points) of −Σ log s, and Σ ∇s (2 − wanted/s)/s: the step's right side.

        `wanted` is s without the widening; where both are equal, the right side is ∇ Σ log s.
        """
        inverse = 1 / s
        pull = wanted * inverse
        np.subtract(2, pull, out=pull)
        pull *= inverse
        weight = np.multiply(inverse, inverse, out=inverse)
        edged = edges * weight
        m = s.shape[3]
        features = np.concatenate(
            [
                (weight[0] + weight[1]).reshape(-1, m),
                (edged[0] + edged[1]).reshape(-1, m),
                np.sum(edges * edged, axis=(0, 1)),
            ]
        )
        turned = edges * pull
        right = np.concatenate(
            [
                (pull[0] - pull[1]).reshape(-1, m),
                turned[0, 0] + turned[0, 1] - turned[1, 0] - turned[1, 1],
            ]
        )
        return self.hessian @ features, self.gradient @ right

    def centre(self, pixels: Array, points: Array, feasible: Mask) -> None:
        """Overwrite points (3, frames, m) with the centres for pixels (cameras, 2, frames, m)."""
        frames = points.shape[1]
        active = np.flatnonzero(np.isfinite(points).all(axis=(0, 1)))
        x = points.take(active, axis=2)  # take and compress stay contiguous, indexing does not
        x[:2] = x[:2].mean(axis=1, keepdims=True)
        uv = pixels.take(active, axis=3).reshape(len(pixels), 2, -1).swapaxes(0, 1) - self.middle
        edges = np.stack([uv - 0.5, uv + 0.5])
        s = self.slacks(edges, x.reshape(3, -1))
        widened = np.maximum(_MARGIN_RATIO * np.abs(s[0] + s[1]) - s, 0)
        tau = 1.0 - _all_slacks(widened == 0, frames)
        for number in range(_MAX_STEPS):
            if not len(active):
                return
            wanted = self.slacks(edges, x.reshape(3, -1))
            s = wanted + np.tile(tau, frames) * widened if tau.any() else wanted
            hessian, right = self.newton(edges, s, wanted)
            step = _solve_arrow(hessian.reshape(6, frames, -1), right.reshape(3, frames, -1))
            after = self.slacks(edges, (x + step).reshape(3, -1))
            after /= s
            shrink = 1 - np.min(after, axis=(0, 1, 2)).reshape(frames, -1).min(axis=0)
            decrement = np.sqrt(np.sum(step * right.reshape(3, frames, -1), axis=(0, 1)))
            inside = tau == 0
            length = np.where(
                inside,
                np.where(decrement < _MAX_QUADRATIC_DECREMENT, 1, 1 / (1 + shrink)),
                np.minimum(1, 0.95 / np.maximum(shrink, 1e-9)),
            )
            x += length * step
            tau *= 1 - length
            done = inside & (decrement < _MAX_CENTRED_DECREMENT)
            # Slacks of an empty polytope can be lost in round-off.
            done &= _all_slacks(wanted > 0, frames)
            last = number == _MAX_STEPS - 1
            if last or np.count_nonzero(done) > _MIN_FINISHED_SHARE * len(done):
                points[:, :, active[done]] = x[:, :, done]
                feasible[active[done]] = True
                left, every = ~done, np.tile(~done, frames)
                active, x, tau = active[left], x.compress(left, axis=2), tau[left]
                edges, widened = (a.compress(every, axis=3) for a in (edges, widened))


def _all_slacks(holds: Mask, frames: int) -> Mask:
    """Test whether all slacks (2, 2, cameras, frames × m) of a marker meet a condition, (m,)."""
    each = np.all(holds, axis=(0, 1, 2))
    return np.asarray(np.all(each.reshape(frames, -1), axis=0), bool)


def _solve_arrow(matrix: Array, right: Array) -> Array:
    """Solve for steps (3, frames, m) with common x and y, from each frame's Hessian (6, ...).

    Eliminating z of every frame leaves a 2×2 system for x and y.
    """
    xx, xy, xz, yy, yz, zz = matrix
    gx, gy, gz = right
    fx, fy = xz / zz, yz / zz
    a, b, d = (np.sum(part, axis=0) for part in (xx - fx * xz, xy - fx * yz, yy - fy * yz))
    p, q = np.sum(gx - fx * gz, axis=0), np.sum(gy - fy * gz, axis=0)
    slope = b / a
    y = (q - slope * p) / (d - slope * b)
    x = (p - b * y) / a
    z = (gz - xz * x - yz * y) / zz
    return np.stack([np.broadcast_to(x, z.shape), np.broadcast_to(y, z.shape), z])
