"""Values of parameters, beside those of the thesis, that every figure set must take."""

from thesis_lib.figure_sets.registry import STUDIES

PAIR = [[80, 10], [-80, 10]]
# What one more, or the first of a list, is not another permitted value of.
CHANGES = {
    "rest": "known",
    "azimuth_zero": "X",
    "principal_offset_px": 0.25,
    "estimator": "analytic-centre",
    "repeats": 3,
    "resolution_px": [320, 181],
    "pair_order": {"4d": "printed"},
    "layouts": {"mine": [PAIR]},
    "grid": [16, 10],
    "plane_shape": [149, 100],
    "lens_k1": -0.05,
    "codec": "h264",
    "width_px": 1280,
}
SHAPE_CHANGES = {
    "outline_mm": [[0, 0], [668, 0], [668, 440], [0, 443]],
    "circles_mm": [[100, 100, 30]],
    "cutouts_mm": [[[100, 200], [150, 210], [120, 240]]],
    "support": "clamped",
    "edge_supports": {"2": "free"},
    "force_mm": [60, 60],
}
SPECIAL = {
    "cameras": {"sensors_mm": {"one": [4, 3]}, "bayer_pattern": "GRBG"},
    "lab-layout": {
        "focal_length_mm": 23,
        "elevation_deg": 21,
        "directions_deg": [[10, 22], [-10, 22], [60, 30]],
    },
    "lab-equal-pixels": {"frequency_hz": 12, "width_px": 300, "grid": [5, 4]},
    "lab-radiation": {"azimuths_deg": [-35, 30, 170]},
    "lab-modes": {
        "amplitude_mm": 1,
        "exposure_ms": 1,
        "width_px": 960,
        "torsion_mm": 0,
        "starts": "together",
    },
    "lab-plate": {"exposure_ms": 0.1, "frame_rate_hz": 59},
    "shape-l": SHAPE_CHANGES,
    "shape-holes": SHAPE_CHANGES,
}
OWN_CHANGES: dict[str, dict] = {}  # of every parameter
for name, model in STUDIES.items():
    known = CHANGES | SPECIAL.get(name, {})
    for field, default in model():
        other = default[:1] if isinstance(default, list) else default
        if isinstance(default, int | float):
            other = default + type(default)(1)
        if field != "cube":
            OWN_CHANGES.setdefault(name, {})[field] = known.get(field, other)
