"""Animations of the measured shape and of the tracked markers."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from PIL import Image as Pictures

from thesis_lib.arrays import NDArray
from thesis_lib.measure.exchange.files import marker_edges, marker_faces
from thesis_lib.measure.recordings import media, media_info
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.plotting.style import in_style
from thesis_lib.studies.cubes import complex_of

Frame = NDArray[np.uint8]  # (height, width, 3), RGB
FRAMES_A_PERIOD, FRAME_RATE_HZ = 24, 12
SHOWN_PERIODS = 3  # in the video
SHAPE_SIZE_PX = 720, 480
DRAWN_DEFLECTION = 0.12  # largest drawn deflection over the structure's length
SHAPE_COLORMAP = "PuOr"
MAX_OVERLAY_S, MAX_OVERLAY_WIDTH_PX = 4.0, 960  # of the video with markers
FOUND_COLOUR, LOST_COLOUR = (255, 92, 0), (255, 0, 190)  # of a marker


def write_shape(path: Path, data: xr.Dataset) -> None:
    """Write an animated shape as ``.gif`` and ``.mp4``; the path has no suffix."""
    frames = draw_period(data)
    write_gif(path.with_name(f"{path.name}.gif"), frames, FRAME_RATE_HZ)
    write_mp4(path.with_name(f"{path.name}.mp4"), SHOWN_PERIODS * frames, FRAME_RATE_HZ)


def draw_period(data: xr.Dataset) -> list[Frame]:
    """Draw one period of the fitted motion in oblique view, coloured by deflection."""
    amplitude = 1e3 * complex_of(data, "amplitude")
    known = np.isfinite(amplitude)
    amplitude, x, y = amplitude[known], data["x"].values[known], data["y"].values[known]
    x, y = (1e3 * (places - 0.5 * (places.min() + places.max())) for places in (x, y))
    most, length = float(np.abs(amplitude).max()), float(max(np.ptp(x), np.ptp(y)))
    scale = DRAWN_DEFLECTION * length / most
    corners, lines = marker_faces(x / 1e3, y / 1e3), marker_edges(x / 1e3, y / 1e3)
    with in_style():
        figure = Figure(figsize=(SHAPE_SIZE_PX[0] / 100, SHAPE_SIZE_PX[1] / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes: Any = figure.add_axes((0, -0.2, 1, 1.5), projection="3d")
        spans = [max(float(np.ptp(places)), 1e-9) for places in (x, y)]  # no axis without length
        axes.set_box_aspect([*np.maximum(spans, length / 20), 2 * scale * most], zoom=0.95)
        along, across = ((-span / 2, span / 2) for span in spans)
        axes.set(xlim=along, ylim=across, zlim=(-scale * most, scale * most))
        axes.view_init(28, -60)
        axes.set_axis_off()
        bar = figure.add_axes((0.25, 0.1, 0.5, 0.025))
        painted = ScalarMappable(Normalize(-most, most), SHAPE_COLORMAP)
        figure.colorbar(painted, cax=bar, orientation="horizontal", label="deflection in mm")
        still = _draw_canvas(canvas)
        bar.set_visible(False)  # it is drawn once
        frames = []
        for k in range(FRAMES_A_PERIOD):
            w = np.real(amplitude * np.exp(2j * np.pi * k / FRAMES_A_PERIOD))
            points = np.column_stack([x, y, scale * w])
            tints = painted.to_rgba(w)
            net = Line3DCollection(points[lines], colors="#555c69", linewidths=0.7)
            drawn = [axes.add_collection3d(net)]
            drawn.append(axes.scatter(*points.T, c=tints, s=16, edgecolors="#333", linewidths=0.4))
            if len(corners):
                mean = painted.to_rgba(w[corners].mean(axis=1))
                faces = Poly3DCollection(points[corners], facecolors=mean)
                drawn.append(axes.add_collection3d(faces))
            frames.append(np.minimum(_draw_canvas(canvas), still))  # both are on white
            for artist in drawn:
                artist.remove()
    return frames


def _draw_canvas(canvas: FigureCanvasAgg) -> Frame:
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def draw_tracks(own: Recording, video: Path, begin: float) -> Iterator[Frame]:
    """Draw the frames of a camera from a time in s on, with a ring around each tracked marker.

    A cross marks the last position of a lost marker.
    """
    first, _ = own.between(begin, begin)
    count = min(len(own.centres) - first, int(MAX_OVERLAY_S * own.rate) + 1)
    last = np.array(own.centres[first])
    scale = min(1.0, MAX_OVERLAY_WIDTH_PX / own.camera.size[0])
    size = [2 * round(scale * side / 2) for side in own.camera.size]
    pictures = media.read_frames(video, first, clock=own.stamps)
    for image, centres in zip(islice(pictures, count), own.centres[first:], strict=False):
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        colour = cv2.cvtColor(small, cv2.COLOR_GRAY2RGB)
        seen = np.isfinite(centres).all(axis=0)
        last = np.where(seen, centres, last)
        for place, there in zip(last.T, seen, strict=True):
            if np.isfinite(place).all():
                at = [round(16 * (scale * value - 0.5)) for value in place]  # in 1/16 px
                if there:
                    cv2.circle(colour, at, 16 * 6, FOUND_COLOUR, 1, cv2.LINE_AA, 4)
                else:
                    centre = [value // 16 for value in at]
                    cv2.drawMarker(colour, centre, LOST_COLOUR, cv2.MARKER_TILTED_CROSS, 9, 1)
        yield colour.astype(np.uint8)


def write_gif(path: Path, frames: list[Frame], rate: float) -> None:
    """Write frames as an endless GIF, with one palette from every third of them."""
    plain, coverage = Pictures.Dither.NONE, Pictures.Quantize.MAXCOVERAGE
    palette = Pictures.fromarray(np.concatenate(frames[::3])).quantize(method=coverage)
    images = [Pictures.fromarray(one).quantize(palette=palette, dither=plain) for one in frames]
    first, *others = images
    how: Any = {"duration": round(1000 / rate), "save_all": True, "append_images": others}
    first.save(path, "GIF", loop=0, optimize=False, **how)


def write_mp4(path: Path, frames: Iterable[Frame], rate: float) -> None:
    """Write frames of even size as H.264 in an MP4 file that every player and browser plays."""
    remaining = iter(frames)
    first, options = next(remaining), {"movflags": "+faststart"}
    with av.open(media_info.file_address(path), "w", format="mp4", options=options) as file:
        stream = file.add_stream("libx264", rate=Fraction(rate).limit_denominator(1001))
        assert isinstance(stream, av.VideoStream)
        stream.height, stream.width = first.shape[:2]
        # Without mbtree, whose assembly code does not give the same bytes each time.
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "veryfast", "mbtree": "0"}
        for frame in chain([first], remaining):
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
            file.mux(stream.encode(picture))
        file.mux(stream.encode(None))
