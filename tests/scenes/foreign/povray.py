"""Recordings of a vibrating plate by POV-Ray, written by PyAV as telephones do.

POV-Ray traces rays through pinhole cameras of known place; nothing here calls the library but for
the manifest. Frames come at uneven times and unlike rates, as H.264 with AAC in MP4, and the second
telephone is held upright: its frames lie on their side, and the file says how to turn them.
"""

import shutil
import subprocess
from dataclasses import dataclass
from fractions import Fraction

import cv2
import numpy as np
import yaml
from scenes.sounds import turn_film, write_film

POVRAY = shutil.which("povray")
LENGTH, WIDTH, THICKNESS = 0.24, 0.16, 0.002  # m
COLUMNS, ROWS, SPACING, DIAMETER = 6, 4, 0.036, 0.012
TILES, TILE, MARGIN = (7, 5), 0.028, 0.028
FREQUENCY, AMPLITUDE = 13.0, 0.0018  # Hz, m
REST, RAMP, SECONDS = 0.25, 0.15, 1.7  # s
FOCAL = 560.0  # px
SOUND_RATE = 48000
TICK = Fraction(1, 90_000)  # s of time stamps


@dataclass(frozen=True)
class Phone:
    """A pinhole camera that looks at the plate's centre, and its clock."""

    name: str
    centre: tuple[float, float, float]  # m
    size: tuple[int, int]  # px
    rate: float  # frames per second
    start: float  # s
    turned: bool = False  # whether it is held upright

    @property
    def axes(self):
        """To the right, down and forward, as rows."""
        forward = -np.array(self.centre) / np.linalg.norm(self.centre)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(forward, right), forward])

    def seen(self, points):
        """Places (2, n) in px of points (3, n) in m."""
        x, y, z = self.axes @ (points - np.array(self.centre)[:, None])
        return np.array([FOCAL * x / z + self.size[0] / 2, FOCAL * y / z + self.size[1] / 2])

    def stamps(self):
        """When its frames are taken after its start, s: early and late by milliseconds."""
        rng = np.random.default_rng(int(self.rate))
        t = np.arange(int(SECONDS * self.rate)) / self.rate
        t = t + 2e-3 * np.sin(2.2 * t) + 3e-4 * rng.standard_normal(len(t))
        return t - t[0]

    @property
    def scene(self):
        right, down, forward = self.axes
        wide, high = (side / FOCAL for side in self.size)
        return (
            f"camera {{ perspective location {vector(self.centre)} direction {vector(forward)} "
            f"right {vector(wide * right)} up {vector(-high * down)} }}\n"
        )


PHONES = (
    Phone("left", (-0.16, -0.31, 0.31), (560, 320), 59.94, 0.0),
    Phone("right", (0.23, 0.27, 0.32), (360, 560), 50.0, 0.0137, turned=True),
)


def vector(values):
    return "<" + ",".join(f"{v:.9g}" for v in values) + ">"


def marker_places():
    """Markers from the plate's first corner, (2, n), row by row, m."""
    x = LENGTH / 2 + (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * SPACING
    y = WIDTH / 2 + (np.arange(ROWS) - (ROWS - 1) / 2) * SPACING
    return np.stack([np.tile(x, ROWS), np.repeat(y, COLUMNS)])


def shape(x, y):
    """Deflection over its largest, of a plate on simple supports in its mode (2, 1)."""
    return np.sin(2 * np.pi * x / LENGTH) * np.sin(np.pi * y / WIDTH)


def truth():
    """The deflection of every marker, m."""
    return AMPLITUDE * shape(*marker_places())


def envelope(t):
    s = np.clip((t - REST - max(phone.start for phone in PHONES)) / RAMP, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s * s)


def rendered(folder, scene, size, frames=1):
    """The pictures of a scene, grey, (height, width)."""
    folder.mkdir(parents=True, exist_ok=True)
    head = "#version 3.7;\nglobal_settings { assumed_gamma 1 ambient_light 1 }\n"
    (folder / "scene.pov").write_text(head + scene)
    options = f"+W{size[0]} +H{size[1]} -D -V +A0.01 +AM1 +R5 -J +FN8 +KI0 +KF1".split()
    options += ["+KFI0", f"+KFF{frames - 1}"] if frames > 1 else []
    subprocess.run(
        [POVRAY, *options, "+Iscene.pov", "+Oframe.png"], cwd=folder, check=True,
        capture_output=True,
    )  # fmt: skip
    files = sorted(folder.glob("frame*.png"))
    assert len(files) == frames
    return [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]


def flat(grey):
    return f"pigment {{ rgb {grey} }} finish {{ ambient 1 diffuse 0 }}"


def plate_scene(phone, deflections):
    """The plate as facets with a deflection that is each frame's, and its markers as discs."""
    x, y = np.linspace(0, LENGTH, 33), np.linspace(0, WIDTH, 17)
    lines = [
        phone.scene,
        f"#declare Q = array[{len(deflections)}] {{ {','.join(f'{q:.9g}' for q in deflections)} }}",
        "#declare q = Q[frame_number];",
        "background { rgb 0.03 }",
        "mesh {",
    ]
    for i in range(len(x) - 1):
        for j in range(len(y) - 1):
            corner = [
                f"<{a - LENGTH / 2:.9g},{b - WIDTH / 2:.9g},{shape(a, b):.9g}*q>"
                for a, b in ((x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1]))
            ]
            lines.append(f"triangle {{ {corner[0]},{corner[1]},{corner[2]} }}")
            lines.append(f"triangle {{ {corner[0]},{corner[2]},{corner[3]} }}")
    lines.append(flat(0.75) + " }")
    step = 1e-6
    for a, b in marker_places().T:
        height = shape(a, b)
        along = (shape(a + step, b) - shape(a - step, b)) / (2 * step)
        across = (shape(a, b + step) - shape(a, b - step)) / (2 * step)
        lines.append(
            f"disc {{ <{a - LENGTH / 2:.9g},{b - WIDTH / 2:.9g},{height:.9g}*q+0.0002>, "
            f"<{-along:.9g}*q,{-across:.9g}*q,1>, {DIAMETER / 2:.9g} {flat(0.05)} }}"
        )
    return "\n".join(lines)


def board_scene(phone, R, t):
    def sheet(x0, y0, x1, y1, z, grey):
        corners = [R @ [x, y, z] + t for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        a, b, c, d = map(vector, corners)
        return f"mesh {{ triangle {{ {a},{b},{c} }} triangle {{ {a},{c},{d} }} {flat(grey)} }}"

    nx, ny = TILES
    left, low = -nx * TILE / 2, -ny * TILE / 2
    lines = [phone.scene, "background { rgb 0.2 }",
             sheet(left - MARGIN, low - MARGIN, -left + MARGIN, -low + MARGIN, 0, 0.8)]  # fmt: skip
    for row, column in np.argwhere(np.indices((ny, nx)).sum(axis=0) % 2 == 0):
        x, y = left + column * TILE, low + row * TILE
        lines.append(sheet(x, y, x + TILE, y + TILE, 1e-6, 0.05))
    return "\n".join(lines)


def poses(count=9):
    """Turns and places of the board, tilted to all sides, its middle near the plate's."""
    k = np.arange(count)
    tilt, way = np.radians(9 + 7.0 * (k % 3)), 2.4 * k
    found = []
    for a, b, n in zip(tilt, way, k, strict=True):
        tilted = cv2.Rodrigues(a * np.array([np.cos(b), np.sin(b), 0]))[0]
        rolled = cv2.Rodrigues(np.array([0, 0, np.radians(8.0 * (n % 4) - 12)]))[0]
        place = [0.03 * np.cos(3.9 * n), 0.02 * np.sin(2.3 * n), 0.015 * np.cos(1.7 * n)]
        found.append((tilted @ rolled, np.array(place)))
    return found


def film(folder):
    """Render and code all that is filmed; the manifest."""
    rng = np.random.default_rng(4)
    for phone in PHONES:
        stamps = phone.stamps()
        since = stamps + phone.start
        q = AMPLITUDE * envelope(since) * np.sin(2 * np.pi * FREQUENCY * since)
        work = folder / "work" / phone.name
        frames = rendered(work, plate_scene(phone, q), phone.size, len(q))
        write(folder / f"{phone.name}.mp4", phone, [noisy(frame, rng) for frame in frames], stamps)
        (folder / phone.name).mkdir()
        for k, (R, t) in enumerate(poses()):
            (board,) = rendered(work / f"board{k}", board_scene(phone, R, t), phone.size)
            cv2.imwrite(str(folder / phone.name / f"{k:02d}.jpg"), noisy(board, rng), [1, 95])
    shutil.rmtree(folder / "work")
    path = folder / "manifest.yaml"
    path.write_text(yaml.safe_dump(manifest(), sort_keys=False))
    return path


def noisy(picture, rng):
    """A picture slightly out of focus, with the noise of a sensor."""
    soft = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.6)
    return np.clip(np.rint(soft + 1.2 * rng.standard_normal(soft.shape)), 0, 255).astype(np.uint8)


def write(path, phone, frames, stamps):
    """H.264 in colour at frames' own times, with the force as AAC; turned if the phone was."""
    t = np.arange(int(SECONDS * SOUND_RATE)) / SOUND_RATE + phone.start
    sound = 0.4 * envelope(t) * np.cos(2 * np.pi * FREQUENCY * t)
    stored = [np.rot90(image) if phone.turned else image for image in frames]
    tinted = [np.rint(np.stack([image, 0.97 * image, 0.92 * image], axis=-1)) for image in stored]
    ticks = np.rint(stamps / float(TICK)).astype(int).tolist()
    write_film(path, [sound], SOUND_RATE, frames=[image.astype(np.uint8) for image in tinted],
               frame_rate=phone.rate, times=ticks, tick=TICK, pictures="libx264",
               options={"crf": "23", "preset": "medium"})  # fmt: skip
    if phone.turned:  # shown a quarter to the right
        turn_film(path, path, (0, 1, -1, 0))


def manifest():
    """What a user would write."""
    corner = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1], [0, 0, 0, 0]]) / 2
    corners = corner * np.array([[LENGTH], [WIDTH], [0]])
    return {
        "structure": {
            "kind": "plate", "length_mm": 1e3 * LENGTH, "width_mm": 1e3 * WIDTH,
            "thickness_mm": 1e3 * THICKNESS, "density_kg_m3": 2700, "youngs_modulus_pa": 7e10,
            "force_position_mm": 60,
            "markers": {
                "rows": ROWS, "columns": COLUMNS, "spacing_mm": 1e3 * SPACING,
                "row_spacing_mm": 1e3 * SPACING, "diameter_mm": 1e3 * DIAMETER,
            },
        },
        "cameras": [
            {
                "name": phone.name, "video": f"{phone.name}.mp4", "width_px": phone.size[0],
                "height_px": phone.size[1], "frame_rate_hz": phone.rate, "exposure_s": 1e-4,
                "board_images": phone.name,
                "corners_px": np.rint(phone.seen(corners)).T.tolist(),
            }
            for phone in PHONES
        ],
        "board": {"columns": TILES[0], "rows": TILES[1], "tile_mm": 1e3 * TILE,
                  "margin_mm": 1e3 * MARGIN, "two_sided": False},
        "excitation": {"frequency_hz": FREQUENCY, "rest_duration_s": REST,
                       "steady_interval_s": [0.45, 1.6]},
    }  # fmt: skip
