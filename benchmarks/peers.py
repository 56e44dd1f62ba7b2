"""Triangulation of the same points from the same images by the library and by what others wrote.

Each contender is given its input in the form it likes best, outside the time. Times are processor
time, one thread, so that neither other jobs nor more threads count; contenders take turns.
"""

from __future__ import annotations

import importlib
import itertools
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from benchmarks.limits import processor_seconds
from benchmarks.own import FOCAL_PX, SIZE
from benchmarks.reference import svd_triangulate
from thesis_lib.arrays import Array
from thesis_lib.vision.pinhole import (
    CameraArray,
    hemisphere_directions,
    hemisphere_rotations,
    intrinsics,
    project,
)
from thesis_lib.vision.triangulation import point_covariance, triangulate

SIGMA_PX = 12**-0.5  # as much as whole pixels scatter
PACKAGES = {"OpenCV": "opencv-python-headless", "pycolmap": "pycolmap",
            "aniposelib": "aniposelib", "SciPy": "scipy", "Acoular": "acoular"}  # fmt: skip
MAX_POINTS = 100_000  # that any contender is given


@dataclass(frozen=True)
class Scene:
    """Cameras at unequal distances around a beam, its points, and their noisy images in px."""

    cameras: CameraArray
    points: Array
    uv: Array

    def first(self, n_points: int) -> Scene:
        """The same with fewer points."""
        images = np.ascontiguousarray(self.uv[:, :, :n_points])
        return Scene(self.cameras, self.points[:, :n_points], images)

    @property
    def translations(self) -> Array:
        """From world to camera, shape (cameras, 3)."""
        return -np.einsum("nij,nj->ni", self.cameras.R_camera_world, self.cameras.centres)

    @property
    def poses(self) -> Array:
        """[R | t], shape (cameras, 3, 4)."""
        return np.concatenate([self.cameras.R_camera_world, self.translations[:, :, None]], axis=2)

    @property
    def rays(self) -> Array:
        """Images at unit distance in the camera frame, (points, cameras, 3)."""
        ones = np.ones_like(self.uv[:, :1])
        rays = np.linalg.inv(self.cameras.K) @ np.concatenate([self.uv, ones], axis=1)
        return np.ascontiguousarray(rays.transpose(2, 0, 1))


def scene(n_cameras: int, n_points: int) -> Scene:
    """Cameras over an arc of 100° at 0.5 to 1.5 m; independent Gaussian errors of the images."""
    rng = np.random.default_rng(0)
    azimuth = np.radians(np.linspace(-50, 50, n_cameras))
    elevation = np.radians(np.linspace(15, 40, n_cameras))
    centres = np.geomspace(0.5, 1.5, n_cameras)[:, None] * hemisphere_directions(azimuth, elevation)
    K = np.stack([intrinsics(FOCAL_PX, SIZE)] * n_cameras)
    cameras = CameraArray(K, hemisphere_rotations(azimuth, elevation), centres, SIZE)
    limits = np.array([0.312, 0.015, 0.0055])[:, None]
    points = rng.uniform(-limits, limits, (3, n_points))
    uv = project(cameras.P, points)
    uv += rng.normal(0, SIGMA_PX, uv.shape)
    return Scene(cameras, points, uv)


@dataclass(frozen=True)
class Contender:
    """One way to triangulate.

    `prepare` takes the scene and gives the call that is timed; what the call returns becomes
    points (3, n) by `points_of`.
    """

    name: str
    package: str
    refined: bool
    n_points: int
    prepare: Callable[[Scene], Callable[[], Any]]
    points_of: Callable[[Any], Array] = np.asarray


def _library(steps: int) -> Callable[[Scene], Callable[[], Any]]:
    return lambda s: lambda: triangulate(s.cameras.P, s.uv, steps)


def _svd(steps: int) -> Callable[[Scene], Callable[[], Any]]:
    return lambda s: lambda: svd_triangulate(s.cameras.P, s.uv, steps, full_matrices=False)


def _opencv(s: Scene) -> Callable[[], Any]:
    import cv2

    P, uv = s.cameras.P, s.uv
    return lambda: cv2.triangulatePoints(P[0], P[1], uv[0], uv[1])


def _pycolmap(s: Scene) -> Callable[[], Any]:
    import pycolmap

    poses, rays = list(s.poses), s.rays / np.linalg.norm(s.rays, axis=2, keepdims=True)
    return lambda: [pycolmap.triangulate_multi_view_point(poses, each) for each in rays]


def _pycolmap_refined(s: Scene) -> Callable[[], Any]:
    """Bundle adjustment by Ceres of the points alone, from the linear estimate."""
    import pycolmap

    model, config = pycolmap.Reconstruction(), pycolmap.BundleAdjustmentConfig()
    for i in range(len(s.cameras)):
        K = s.cameras.K[i]
        parameters = [K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
        width, height = SIZE
        camera = pycolmap.Camera(camera_id=i + 1, model="PINHOLE", width=width, height=height,
                                 params=parameters)  # fmt: skip
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(
            name=str(i), keypoints=s.uv[i].T.copy(), camera_id=i + 1, image_id=i + 1
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(s.poses[i]))
        config.add_image(i + 1)
        config.set_constant_cam_intrinsics(i + 1)
        config.set_constant_rig_from_world_pose(i + 1)
    for j, start in enumerate(triangulate(s.cameras.P, s.uv, steps=0).T):
        seen = [pycolmap.TrackElement(i + 1, j) for i in range(len(s.cameras))]
        model.add_point3D(start, pycolmap.Track(seen))
    ids = sorted(model.point3D_ids())
    starts = [model.points3D[i].xyz.copy() for i in ids]
    options = pycolmap.BundleAdjustmentOptions(
        refine_focal_length=False, refine_extra_params=False, print_summary=False,
        refine_rig_from_world=False, refine_sensor_from_rig=False,
    )  # fmt: skip
    options.ceres.solver_options.num_threads = 1

    def restart() -> None:
        for i, start in zip(ids, starts, strict=True):
            model.points3D[i].xyz = start

    def solve() -> Any:
        pycolmap.create_default_bundle_adjuster(options, config, model).solve()
        return [model.points3D[i].xyz for i in ids]

    solve.restart = restart  # type: ignore[attr-defined]
    return solve


def _aniposelib_group(s: Scene) -> Any:
    import cv2
    from aniposelib.cameras import Camera, CameraGroup

    return CameraGroup([
        Camera(matrix=K, dist=np.zeros(5), size=SIZE, rvec=cv2.Rodrigues(R)[0].ravel(), tvec=t,
               name=str(i))
        for i, (K, R, t) in enumerate(
            zip(s.cameras.K, s.cameras.R_camera_world, s.translations, strict=True))
    ])  # fmt: skip


def _aniposelib(fast: bool) -> Callable[[Scene], Callable[[], Any]]:
    def prepare(s: Scene) -> Callable[[], Any]:
        group = _aniposelib_group(s)
        rays = np.ascontiguousarray(s.rays.transpose(1, 0, 2)[:, :, :2])
        return lambda: group.triangulate(rays, undistort=False, fast=fast)

    return prepare


def _aniposelib_refined(s: Scene) -> Callable[[], Any]:
    """Its optimisation of points without its smoothness in time, from the linear estimate."""
    group = _aniposelib_group(s)
    images = np.ascontiguousarray(s.uv.transpose(0, 2, 1)[:, :, None])
    start = triangulate(s.cameras.P, s.uv, steps=0).T[:, None]
    return lambda: group.optim_points(images, start, scale_smooth=0, reproj_loss="linear")


def _scipy_refined(s: Scene) -> Callable[[], Any]:
    """Levenberg–Marquardt of MINPACK, point by point, from the linear estimate."""
    from scipy.optimize import least_squares

    P, starts = s.cameras.P, triangulate(s.cameras.P, s.uv, steps=0).T
    a, b = P[:, :, :3], P[:, :, 3]

    def residual(x: Array, uv: Array) -> Array:
        image = a @ x + b
        return (image[:, :2] / image[:, 2:] - uv).ravel()

    def jacobian(x: Array, _: Array) -> Array:
        image = a @ x + b
        h = image[:, :2] / image[:, 2:]
        J: Array = (a[:, :2] - h[:, :, None] * a[:, 2:]) / image[:, 2:, None]
        return J.reshape(-1, 3)

    pairs = list(zip(starts, s.uv.transpose(2, 0, 1), strict=True))
    return lambda: [
        least_squares(residual, x, jac=jacobian, method="lm", args=(uv,)).x for x, uv in pairs
    ]


def _rows(points: Any) -> Array:
    return np.reshape(points, (-1, 3)).T


CONTENDERS = (
    Contender("thesis_lib, NumPy", "", False, 100_000, _library(0)),
    Contender("NumPy's svd, batched", "", False, 20_000, _svd(0)),
    Contender("OpenCV triangulatePoints", "OpenCV", False, 100_000, _opencv,
              lambda x: x[:3] / x[3]),
    Contender("pycolmap triangulate_multi_view_point", "pycolmap", False, 5000, _pycolmap, _rows),
    Contender("aniposelib triangulate", "aniposelib", False, 100_000, _aniposelib(False), _rows),
    Contender("aniposelib triangulate, fast", "aniposelib", False, 20_000, _aniposelib(True),
              _rows),
    Contender("thesis_lib, NumPy", "", True, 100_000, _library(3)),
    Contender("NumPy's svd and solve, batched", "", True, 10_000, _svd(3)),
    Contender("pycolmap, Ceres, points alone", "pycolmap", True, 5000, _pycolmap_refined, _rows),
    Contender("aniposelib optim_points", "aniposelib", True, 300, _aniposelib_refined, _rows),
    Contender("SciPy least_squares, each point", "SciPy", True, 300, _scipy_refined, _rows),
)  # fmt: skip


def versions() -> dict[str, str]:
    """Versions of the packages there are, by their short names."""
    found = {"NumPy": np.__version__}
    for name, package in PACKAGES.items():
        try:
            found[name] = version(package)
        except PackageNotFoundError:
            continue
    return found


def missing() -> list[str]:
    """Packages that are not installed."""
    return [name for name in PACKAGES if name not in versions()]


@dataclass(frozen=True)
class Timed:
    """A contender's rates, million points a second, one a round; rms error and bound in µm."""

    cameras: int
    name: str
    package: str
    refined: bool
    points: int
    rates: list[float]
    error_um: float
    bound_um: float

    @property
    def rate(self) -> float:
        """The median."""
        return statistics.median(self.rates)


def compare(
    n_cameras: int,
    repetitions: int = 5,
    most: int = MAX_POINTS,
    absent: tuple[str, ...] | None = None,
) -> Iterator[Timed]:
    """All contenders that are installed, in turns, on at most so many points."""
    absent = tuple(missing()) if absent is None else absent
    whole = scene(n_cameras, min(most, MAX_POINTS))
    field = [
        c for c in CONTENDERS
        if c.package not in absent and (c.package != "OpenCV" or n_cameras == 2)
    ]  # fmt: skip
    parts = [whole.first(min(c.n_points, most)) for c in field]
    calls = [c.prepare(part) for c, part in zip(field, parts, strict=True)]
    found = [c.points_of(call()) for c, call in zip(field, calls, strict=True)]  # warms up, too
    rates: list[list[float]] = [[] for _ in field]
    for _, (rate, part, call) in itertools.product(
        range(repetitions), list(zip(rates, parts, calls, strict=True))
    ):
        rate.append(part.points.shape[1] / _seconds(call) / 1e6)
    for contender, part, points, rate in zip(field, parts, found, rates, strict=True):
        C = point_covariance(whole.cameras.P, part.points[:, :10_000], SIGMA_PX)
        yield Timed(
            n_cameras,
            contender.name,
            contender.package,
            contender.refined,
            part.points.shape[1],
            rate,
            error_um=1e6 * float(np.sqrt(np.mean(np.sum((points - part.points) ** 2, axis=0)))),
            bound_um=1e6 * float(np.sqrt(np.mean(np.trace(C)))),
        )


def _seconds(call: Callable[[], object]) -> float:
    """Processor time of one call, or the median of several that are short."""
    times: list[float] = []
    while len(times) < 5 and sum(times) < 0.4:
        getattr(call, "restart", lambda: None)()
        times.append(processor_seconds(call))
    return statistics.median(times)


def quiet() -> None:
    """Let packages that log on loading do so before a table is printed."""
    for name in ("pycolmap", "aniposelib.cameras", "acoular"):
        try:
            importlib.import_module(name)
        except ImportError:
            continue
