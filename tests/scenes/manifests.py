"""Values of a small manifest, and manifests with one of their values changed."""

from typing import Any

SIZE = (64, 48)  # width and height, px


def plain(cameras="AB", **parts):
    """The values of a manifest of small videos."""
    return {
        "cameras": [
            {
                "name": name, "video": f"{name}.mkv", "width_px": SIZE[0], "height_px": SIZE[1],
                "frame_rate_hz": 60, "exposure_s": 0.004, "board_images": f"shots/{name}",
            }
            for name in cameras
        ]
    } | parts  # fmt: skip


def change(values, place, value):
    """The values with one of them changed, at a place as "cameras.0.video"; ``...`` removes it."""
    if isinstance(place, str):
        place = [int(part) if part.isdecimal() else part for part in place.split(".")]
    *way, last = place
    inside: Any = values
    for part in way:
        inside = inside.setdefault(part, {}) if isinstance(inside, dict) else inside[part]
    if value is ...:
        del inside[last]
    else:
        inside[last] = value
    return values
