"""A page on which the structure's corners are clicked in the first frame of each camera."""

from __future__ import annotations

import base64
from pathlib import Path

import cv2
from markupsafe import Markup

from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.media import read_frames
from thesis_lib.web.fragment import asset, joined, static_html
from thesis_lib.web.html import render_html

PAGE_NAME = "corners.html"
JPEG_QUALITY = 92  # leaves edges where they are, and a page of 16 cameras below 10 MB
TITLE = "Corners of the structure"
WITHOUT = "This page needs JavaScript to read corners."
INTRODUCTION = f"""<h1>{TITLE}</h1>
<p>In each first frame, click the structure's corners in the order (0, 0), (length, 0), (length,
width), (0, width), as the markers count, beginning with the same corner in every camera. Then put
the lines below into the manifest, each in place of its camera's <code>corners_px</code>. A few
pixels do not matter; the order does.</p>
<p>Keys: Tab goes from corner to corner, arrows move one by 1 px, with Shift by 10 px, with Alt by
0.1 px. Nothing leaves this page.</p>
"""


def corners_page(manifest: Manifest, folder: Path) -> str:
    """Return a self-contained HTML page in which corners are clicked, and read as lines of YAML.

    Parameters
    ----------
    manifest : Manifest
        The cameras; the corners that it has already are there to be corrected.
    folder : Path
        Its folder.

    Raises
    ------
    MediaError
        If the first frame of a video cannot be read.
    """
    cameras = []
    for camera in manifest.cameras:
        image = next(read_frames(folder / camera.video, 0, 1))
        _, code = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        cameras.append(
            {
                "name": camera.name,
                "size": image.shape[::-1],
                "image": f"data:image/jpeg;base64,{base64.b64encode(code.tobytes()).decode()}",
                "corners": camera.corners_px,
            }
        )
    state = {"cameras": cameras}
    fragment = static_html(joined("corners"), asset("corners.css"), state, WITHOUT)
    body = Markup(INTRODUCTION + fragment)
    return render_html("web/templates/page.html.j2", title=TITLE, body=body)
