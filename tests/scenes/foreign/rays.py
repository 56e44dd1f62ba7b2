"""A ray caster for beams, which shares nothing with the library's renderer.

The library projects outlines and sums the exact areas of pixels. Here OpenCV undoes the lens, a ray
goes through each of many points of a pixel and asks what it hits, to within their spacing; a round
aperture spreads the light on those points. Light is linear: 0 is black, 1 is the brightest that the
sensor takes.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import j1

WHITE, DARK, BEHIND = 0.75, 0.08, 0.15
SLOPE = 0.15  # how much brighter the right end of the scene is lit than the left
FINE = 4  # rays along each side of a pixel
AIRY = 1.0  # px: λN of the aperture, whose first dark ring is at 1.22 λN
MARGIN = 6  # px around what is drawn: farther than light is spread
EXACT = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-12)


@dataclass(frozen=True)
class Eye:
    """A camera in OpenCV's terms: whole numbers are the centres of pixels."""

    name: str
    size: tuple[int, int]
    K: np.ndarray
    distortion: np.ndarray  # as many coefficients as OpenCV knows
    R: np.ndarray  # from the world to the camera
    centre: np.ndarray

    def project(self, points):
        """Images (2, n) of world points (3, n), counted from the sensor's corner."""
        turn, _ = cv2.Rodrigues(self.R)
        uv, _ = cv2.projectPoints(points.T, turn, -self.R @ self.centre, self.K, self.distortion)
        return uv[:, 0].T + 0.5

    def box(self, points):
        """Columns and rows (u0, v0, u1, v1) that show world points, with a margin."""
        uv = self.project(points)
        low = np.maximum(np.floor(uv.min(axis=1)).astype(int) - MARGIN, 0)
        high = np.minimum(np.ceil(uv.max(axis=1)).astype(int) + MARGIN, self.size)
        return *low, *high

    def directions(self, box):
        """Rays in the world through the points of each pixel: x, y and z, each (rows, columns)."""
        u0, v0, u1, v1 = box
        u, v = np.meshgrid(np.arange(u0 - 1.0, u1 + 1), np.arange(v0 - 1.0, v1 + 1))
        pixels = np.stack([u.ravel(), v.ravel()], axis=-1)[:, None]
        flat = cv2.undistortPoints(pixels, self.K, self.distortion, None, None, None, EXACT)
        x, y = flat[:, 0].T.reshape(2, *u.shape).astype(np.float32)
        x, y = (_refined(_refined(part).T).T for part in (x, y))
        return [a * x + b * y + c for a, b, c in self.R.T.astype(np.float32)]


def _refined(values):
    """Values (n + 2, ...) at the centres of pixels −1…n, at the points in each of 0…n − 1."""
    count = len(values) - 2
    place = (np.arange(count * FINE) + 0.5) / FINE + 0.5  # from the first of the centres
    left = place.astype(int)
    share = (place - left)[:, None].astype(np.float32)
    return (1 - share) * values[left] + share * values[left + 1]


def looking(name, place, roll_deg, size, focal, principal, distortion):
    """A camera at a place that looks at the origin; up is about +Y."""
    place = np.array(place, float)
    z = -place / np.linalg.norm(place)
    x = np.cross([0, -1, 0], z)
    x /= np.linalg.norm(x)
    roll, _ = cv2.Rodrigues(np.array([0, 0, np.radians(roll_deg)]))
    R = roll @ np.stack([x, np.cross(z, x), z])
    K = np.array([[focal[0], 0, (size[0] - 1) / 2 + principal[0]],
                  [0, focal[1], (size[1] - 1) / 2 + principal[1]], [0, 0, 1.0]])  # fmt: skip
    return Eye(name, size, K, np.array(distortion, float), R, place)


def _spread(light):
    """What the diffraction of the aperture makes of the light on the fine points."""
    reach = int(5 * AIRY * FINE)
    x = np.arange(-reach, reach + 1) / FINE
    r = np.maximum(np.pi * np.hypot(x, x[:, None]) / AIRY, 1e-9)
    kernel = (2 * j1(r) / r) ** 2
    return cv2.filter2D(light, -1, kernel.astype(np.float32) / kernel.sum())


def _soft(inside, spacing):
    """1 inside and 0 outside of an edge, straight over one spacing of the rays between."""
    return np.clip(inside / np.float32(spacing) + np.float32(0.5), 0, 1)


def _spacing(x, y):
    """Mean distance of neighbouring rays where they meet a plane, m."""
    (xv, xu), (yv, yu) = [
        [np.diff(part[::7, ::7], axis=axis).mean() / 7 for axis in (0, 1)] for part in (x, y)
    ]
    return np.sqrt(abs(xu * yv - xv * yu))


# What is seen.


@dataclass(frozen=True)
class Strip:
    """A beam with rows of dark discs and a hole, in m; it bends up along z."""

    length: float = 0.623
    width: float = 0.030
    columns: int = 25
    rows: int = 3
    spacing: float = 0.025
    row_spacing: float = 0.010
    diameter: float = 0.005
    hole: tuple[float, float] = (0.024, 0.010)

    @property
    def points(self):
        """Centres of the markers from the clamped corner, (2, n), row by row."""
        x = self.length / 2 + (np.arange(self.columns) - (self.columns - 1) / 2) * self.spacing
        y = self.width / 2 + (np.arange(self.rows) - (self.rows - 1) / 2) * self.row_spacing
        return np.stack([np.tile(x, self.rows), np.repeat(y, self.columns)])

    def shape(self, x):
        """What a uniform load does to a cantilever, 1 at the tip."""
        s = x / self.length
        return s * s * (6 - 4 * s + s * s) / 3

    def world(self, tip=0.0):
        """Centres of the markers in the world, (3, n), for a deflection of the tip."""
        x, y = self.points
        return np.stack([x - self.length / 2, y - self.width / 2, tip * self.shape(x)])


class Film:
    """What one camera sees of a beam whose tip moves; rows may be read one after the other."""

    def __init__(self, eye, strip, tip, most, exposure, row_time):
        self.eye, self.strip, self.tip, self.row_time = eye, strip, tip, row_time
        rim = [[x, y, z] for x in np.linspace(-0.5, 0.5, 9) * strip.length
               for y in (-0.5 * strip.width, 0.5 * strip.width) for z in (-most, most)]  # fmt: skip
        self.box = eye.box(np.array(rim).T)
        dx, dy, dz = eye.directions(self.box)
        cx, cy, cz = eye.centre.astype(np.float32)
        self.along, self.across = dx / dz, dy / dz  # x and y of a ray for each m of height
        self.x = cx - cz * self.along + np.float32(strip.length / 2)
        self.y = cy - cz * self.across + np.float32(strip.width / 2)
        self.spacing = _spacing(self.x, self.y)
        # Every point of a pixel has its own moment of the exposure, in an order of its own.
        rows, columns = (n // FINE for n in self.x.shape)
        order = np.tile(np.arange(FINE**2, dtype=np.uint8), (rows, columns, 1))
        order = np.random.default_rng([0, 7]).permuted(order, axis=2)
        order = order.reshape(rows, columns, FINE, FINE).swapaxes(1, 2)
        self.moment = order.reshape(self.x.shape)
        self.moments = exposure * ((np.arange(FINE**2) + 0.5) / FINE**2 - 0.5)

    def picture(self, time):
        """The linear picture exposed around a time."""
        u0, v0, u1, v1 = self.box
        late = np.arange(v0, v1) * self.row_time
        tips = self.tip(time + late[:, None] + self.moments).astype(np.float32)
        tip = tips[np.repeat(np.arange(v1 - v0), FINE)[:, None], self.moment]
        x, length = self.x, np.float32(self.strip.length)
        for _ in range(3):  # where a ray meets the bent surface
            s = np.clip(x, 0, length) / length
            z = tip * (s * s * (6 - 4 * s + s * s) / 3)
            x = self.x + z * self.along
        y = self.y + z * self.across
        light = _spread(self._light(x, y))
        picture = np.full(self.eye.size[::-1], BEHIND, np.float32)
        picture[v0:v1, u0:u1] = light.reshape(v1 - v0, FINE, u1 - u0, FINE).mean(axis=(1, 3))
        return picture

    def _light(self, x, y):
        strip, radius = self.strip, np.float32(self.strip.diameter / 2)
        x0, y0 = strip.points[:, 0].astype(np.float32)
        i = np.clip(np.rint((x - x0) / np.float32(strip.spacing)), 0, strip.columns - 1)
        j = np.clip(np.rint((y - y0) / np.float32(strip.row_spacing)), 0, strip.rows - 1)
        dx = x - x0 - i * np.float32(strip.spacing)
        dy = y - y0 - j * np.float32(strip.row_spacing)
        ink = _soft(radius - np.sqrt(dx * dx + dy * dy), self.spacing)
        light = WHITE - np.float32(WHITE - DARK) * ink
        light *= 1 + np.float32(SLOPE) * (x / np.float32(strip.length) - 0.5)
        hx, hy = np.float32(strip.hole[0]), np.float32(strip.hole[1])
        inside = np.minimum(np.minimum(x, np.float32(strip.length) - x),
                            np.minimum(y, np.float32(strip.width) - y))  # fmt: skip
        inside = np.minimum(inside, np.sqrt((x - hx) ** 2 + (y - hy) ** 2) - radius)
        return BEHIND + _soft(inside, self.spacing) * (light - BEHIND)


# What the sensor makes of it.


def grey(light, rng, shot=0.05, read=1.0):
    """8-bit grey levels of a linear picture, with `shot` times these as variance of the noise."""
    level = 255 * light
    spread = np.sqrt(shot * level + read**2)
    level = level + spread * rng.standard_normal(level.shape, np.float32)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)
