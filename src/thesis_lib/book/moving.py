"""The README's moving picture: the explorer of the rendered book, frame by frame, as one GIF.

``python -m thesis_lib.book.moving`` makes it anew by the Chromium of this machine (`make picture`).
"""

from __future__ import annotations

import io
import math
from pathlib import Path

from thesis_lib.book.pdf import FLAGS, find_browser
from thesis_lib.files import project_root, whole_file

PICTURE = "data/published/explorer.gif"
FRAMES, PERIODS, MILLISECONDS = 48, 2, 80  # of the whole, and how long each frame stands
COLOURS = 64
ASKED = "s=beam&m=3&w=320&f=24&d=600&c=7,15;-7,15;30,25;-50,25"
SWUNG, DEGREES = 3, 45  # the camera that is dragged there and back, and how far
_FRAME = """async ([phase, camera, azimuth]) => {
  const root = document.querySelector('.tl-explorer'), { app } = root.explorer;
  app.update({ c: app.state.c.map((one, i) => (i === camera ? [azimuth, one[1]] : one)) });
  root.moving.motion.put(phase);
  while (app.result?.means.length !== 100) await new Promise(requestAnimationFrame);
}"""
_STYLE = """
.tl-explorer .tl-controls, .tl-ex-hint, .tl-time, .tl-ex-export { display: none !important; }
.tl-viewer.tl-explorer .tl-ex-columns .tl-ex-view { height: 480px; }
"""


def frames(page: Path) -> list[bytes]:
    """Pictures (PNG) of a page's explorer while its beam bends and one camera goes round."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=find_browser(), args=FLAGS)
        try:
            opened = chromium.new_context(
                offline=True,
                color_scheme="light",
                reduced_motion="reduce",
                viewport={"width": 900, "height": 900},
            ).new_page()
            opened.goto(f"{page.resolve().as_uri()}?{ASKED}", wait_until="load")
            opened.add_style_tag(content=_STYLE)
            explorer = opened.locator(".tl-explorer")
            found = []
            for i in range(FRAMES):
                share = 2 * math.pi * i / FRAMES
                azimuth = round(-50 - DEGREES * (1 - math.cos(share)) / 2, 1)
                opened.evaluate(_FRAME, [math.degrees(share * PERIODS) % 360, SWUNG, azimuth])
                found.append(explorer.screenshot())
            return found
        finally:
            chromium.close()


def write(page: Path, picture: Path) -> None:
    """Write the explorer of a page as a moving picture that repeats."""
    from PIL import Image

    shots = [Image.open(io.BytesIO(shot)).convert("RGB") for shot in frames(page)]
    palette = shots[0].quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    drawn = [shot.quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]

    def fill(part: Path) -> None:
        drawn[0].save(
            part,
            format="GIF",
            save_all=True,
            append_images=drawn[1:],
            duration=MILLISECONDS,
            loop=0,
            optimize=True,
        )

    whole_file(picture, fill)


if __name__ == "__main__":
    root = project_root()
    write(root / "build" / "html" / "intro.html", root / PICTURE)
    print(f"{PICTURE}: {(root / PICTURE).stat().st_size / 1000:.0f} kB")
