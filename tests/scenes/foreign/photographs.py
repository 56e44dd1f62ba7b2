"""Real photographs of a chessboard: the stereo pair among OpenCV's samples, 26 pictures of 0.7 MB.

They are part of OpenCV's source distribution, which is larger by a factor of a hundred, so they are
fetched once, as ``python tests/scenes/foreign/photographs.py`` from the project's folder, with the
hash in requirements.lock, and tests that need them are skipped without. The board has 9 × 6 inner
corners, 25 mm apart; shot 10 is missing on both sides.
"""

import re
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

PROJECT = Path(__file__).parents[3]
FOLDER = PROJECT / "build" / "photographs"
SHOTS = [i for i in range(1, 15) if i != 10]
FILES = [f"{side}{i:02d}.jpg" for side in ("left", "right") for i in SHOTS]
CALIBRATION = "left_intrinsics.yml"
PACKAGE = "opencv-python-headless"


def fetch():
    """Put the photographs into FOLDER; nothing is built or installed."""
    lock = (PROJECT / "requirements.lock").read_text(encoding="utf-8")
    pinned = re.findall(rf"^{PACKAGE}==(?:.*\\\n)+.*\n", lock, re.MULTILINE)  # by platform
    assert pinned, f"requirements.lock: no {PACKAGE}"
    with tempfile.TemporaryDirectory() as folder:
        wanted = Path(folder) / "wanted.lock"
        wanted.write_text("".join(pinned), encoding="utf-8")
        subprocess.run(
            [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check",
             "--no-deps", "--no-binary", PACKAGE, "--require-hashes", "-r", wanted,
             "--dest", folder],
            check=True,
        )  # fmt: skip
        (archive,) = Path(folder).glob("*.tar.gz")
        FOLDER.mkdir(parents=True, exist_ok=True)
        left = {*FILES, CALIBRATION}
        with tarfile.open(archive) as tar:
            for member in tar:
                path = Path(member.name)
                if path.parent.parts[1:] == ("opencv", "samples", "data") and path.name in left:
                    (FOLDER / path.name).write_bytes(tar.extractfile(member).read())
                    left.remove(path.name)
    assert not left, f"not in {PACKAGE}: {sorted(left)}"


if __name__ == "__main__":
    fetch()
