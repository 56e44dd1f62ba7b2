"""What a reader should know before trusting a measurement, one line each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.jackknife import FEWEST
from thesis_lib.measure.calibration.rig import MAX_CONTRADICTION
from thesis_lib.measure.fitting.models import rms
from thesis_lib.measure.fitting.result import SCALE
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report.meanings import Note

LOST = 0.05  # share of the frames from which on a camera's lost markers are told
DRIFT = 0.05  # change of the amplitude from which on the vibration is not called steady
WIDE = 1.5  # motion in the plane over what scatter explains, from which on it is told
LITTLE = 0.7  # share of the motion below which the frequency explains little
OTHER = 0.05  # amplitude of another tone over the vibration's, from which on it is told
SLIPPED = 0.1  # periods over the steady part by which a replaced frequency matters
MISFIT = 0.3  # px that markers at rest may be off where all cameras put them
NOMINAL = 1e-5  # relative, by which a file's rate may differ from the manifest's
# Rms residual of the board's corners in all cameras together over that in each alone, from which on
# it is reported: 1.1 on photographs of a paper board at rest, 10 on a board held by hand.
CONTRADICTORY = 2.0
# Frames by which a shift of whole frames may be off: 1.7 ms at 60 Hz, 0.6 m of sound's way
MAX_FRAME_FRACTION = 0.1
MAX_CLOCK_DRIFT = 5e-4  # relative, of cameras' clocks: quartz 1e-5 to 1e-4, ceramics up to 5e-4
UNEVEN = 0.05  # frames by which they may come early or late
APART = 10.0  # degrees by which cameras are out of step if a frequency may be an alias


def notes(data: xr.Dataset) -> list[Note]:
    """What a reader should know before trusting the result."""
    return [*_of_frequency(data), *_of_cameras(data), *_of_markers(data), *_of_shape(data)]


def source_of_size(manifest: Manifest) -> str:
    """What tells how large things are."""
    if manifest.calibration is not None and manifest.calibration.poses == "kept":
        return f"the calibration that was reused, {manifest.calibration.file}"
    return f"the board's tiles of {manifest.board.tile_mm:g} mm"


def _of_frequency(data: xr.Dataset) -> Iterator[Note]:
    used, given = float(data["frequency"]), float(data["frequency_given"])
    error = float(data["frequency_deviation"])
    seconds = float((data["frames"] / data["frame_rate"]).max())
    if abs(used - given) * seconds > SLIPPED:
        yield Note(
            "frequency-replaced",
            f"The manifest's {given:.6g} Hz was replaced by {used:.6g} Hz, which the tracks show "
            f"to ± {error:.1g} Hz.",
        )
    other, ratio = float(data["other_frequency"]), float(data["other_amplitude"])
    explained = float(data["explained"])
    if ratio > 1:
        yield Note(
            "frequency-wrong",
            f"{used:.6g} Hz explains {explained:.0%} of the motion; most of it is at {other:.4g} "
            "Hz: is frequency_hz wrong?",
        )
    elif ratio > OTHER:
        yield Note(
            "other-tone",
            f"{used:.6g} Hz explains {explained:.1%} of the motion; another tone, at {other:.4g} "
            f"Hz, has {ratio:.0%} of its amplitude.",
        )
    elif explained < LITTLE:
        yield Note(
            "little-explained",
            f"{used:.6g} Hz explains only {explained:.0%} of the motion, and no other tone much "
            "of the rest: is frequency_hz wrong, so that markers are not followed, or the motion "
            "lost in noise?",
        )
    lags = dict(zip(data["alias"].values, data["alias_lag"].values, strict=True))
    own, rivals = lags.pop(data["alias"].values[0]), lags
    better = {f: lag for f, lag in rivals.items() if lag < own / 3}
    told = ", ".join(f"{f:.6g} Hz ({lag:.0f}°)" for f, lag in sorted(rivals.items()))
    if own > APART and better:
        best = min(better, key=lambda f: better[f])
        yield Note(
            "maybe-alias",
            f"{used:.6g} Hz may be an alias of {best:.6g} Hz: with it the cameras are {own:.0f}° "
            f"out of step by their starts, with the other {better[best]:.0f}°. These frames show "
            f"alike: {told}.",
        )
    elif used > 0.5 * float(data["frame_rate"].min()) and rivals and np.isnan(own):
        yield Note(
            "alike",
            f"These frames show alike {', '.join(f'{f:.6g} Hz' for f in [used, *rivals])}: that "
            "it is the first, the manifest says, and nothing else.",
        )
    elif used > 0.5 * float(data["frame_rate"].min()) and rivals:
        yield Note(
            "alike",
            f"These frames show alike {used:.6g} Hz ({own:.0f}° out of step by the cameras' "
            f"starts) and {told}: that it is the first, the manifest says.",
        )


def note_repeats(data: xr.Dataset) -> Iterator[Note]:
    """Yield a note for each camera whose frames repeat."""
    for line in data.attrs.get("repeats", "").splitlines():
        yield Note("repeated-frames", f"Frames repeat: {line}")


def note_pace(name: str, first: str, pace: float, error: str = "") -> Note:
    """Return the note on a clock that runs faster than the first camera's by a relative pace."""
    way = "fast" if pace > 0 else "slow"
    ppm = float(f"{1e6 * abs(pace):.3g}")
    how = f"{ppm:,g}{error} ppm {way} against that of {first}"
    if abs(pace) > MAX_CLOCK_DRIFT:
        return Note(
            "frames-lost",
            f"Camera {name}'s clock seems to run {how}: more than any clock. Frames were lost or "
            "repeated, or the file's rate is not the camera's; its times were corrected.",
        )
    return Note("clock-drift", f"Camera {name}'s clock runs {how}; its times were corrected.")


def _whole_frames(frames: float) -> str:
    """Return what a shift by whole frames suggests, empty of any other."""
    count = round(abs(frames))
    if not count or abs(abs(frames) - count) > MAX_FRAME_FRACTION:
        return ""
    lost = f"{count} frames were" if count > 1 else "a frame was"
    return f", or {lost} lost without its time stamps showing it: so long does that take"


def _of_cameras(data: xr.Dataset) -> Iterator[Note]:
    yield from note_repeats(data)
    for k, name in enumerate(data["camera"].values):
        one = data.isel(camera=k)
        rate, given = float(one["frame_rate"]), float(one["frame_rate_given"])
        if abs(rate / given - 1) > NOMINAL:
            yield Note(
                "file-rate",
                f"Camera {name}'s file has {rate:.8g} frames per second, the manifest "
                f"{given:.8g}: each frame counts at the file's time.",
            )
        if (uneven := float(one["uneven"])) > UNEVEN / rate:
            yield Note(
                "uneven-frames",
                f"Camera {name}'s frames come unevenly, {1e3 * uneven:.2g} ms (rms) early or "
                "late: each counts at its own time stamp.",
            )
        if (lost := float(one["missing"].mean())) > LOST:
            yield Note(
                "markers-lost",
                f"Camera {name} lost {lost:.0%} of its marker images.",
            )
        if float(one["jump"]):
            yield Note(
                "camera-jumped",
                f"All that camera {name} sees jumped by {float(one['jump']):.2g} px at "
                f"{float(one['jump_time']):.2f} s: the camera was touched, or the structure "
                "slipped. End steady_s before, or film again.",
            )
        if float(one["corrected"]):
            first = str(data["camera"].values[0])
            error = float(f"{1e6 * float(one['pace_deviation']):.1g}")
            yield note_pace(name, first, float(one["pace"]), f" ± {error:,g}")
        if float(one["lag"]) and data.attrs.get("sound") != "none":
            late, error = 1e3 * float(one["lag"]), 1e3 * float(one["lag_deviation"])
            yield Note(
                "start-by-pictures",
                f"By the pictures camera {name} started {abs(late):.2g} ± {error:.1g} ms "
                f"{'later' if late > 0 else 'earlier'} than by the sound, whose way to it may be "
                f"longer or shorter{_whole_frames(1e-3 * late * rate)}; the pictures decide, to "
                "within whole periods.",
            )
        if float(one["rest_misfit"]) > MISFIT:
            yield Note(
                "rest-misfit",
                f"Camera {name} sees the markers at rest {float(one['rest_misfit']):.2g} px from "
                "where all cameras put them: it moved, zoomed or cropped since the board was "
                "filmed, or another one did.",
            )
    if not np.isfinite(data.get("focal_deviation", 0.0)).all():
        yield Note(
            "calibration-untold",
            "The calibration that was reused does not tell how exact it is: standard errors hold "
            "nothing of its errors, which all markers share.",
        )
    yield from of_board(data)
    if 0 < (poses := int(data.get("board_poses", 0))) < FEWEST:
        yield Note(
            "few-poses",
            f"The board was used in {poses} poses, which is few to tell how exact the calibration "
            "is: its deviations are those by single corners, widened by as much as the poses "
            f"differ more. {FEWEST} or more tell it by themselves.",
        )
    off = float(data["grid_scale"]) - 1
    if abs(off) > SCALE:
        yield Note(
            "grid-scale",
            f"The markers' grid comes out {off:+.2%} in size: tile, spacing, or a zoom or crop "
            "since the board was filmed. Deflections are wrong by as much if it is not the "
            "spacing; standard errors hold that.",
        )


def of_board(data: xr.Dataset) -> Iterator[Note]:
    """Compare the residuals of the board's corners in all cameras with those of each alone."""
    if "single_rms" not in data:  # a calibration that was reused
        return
    together = float(data.get("reprojection_rms", np.nan))
    if together > CONTRADICTORY * (alone := rms(data["single_rms"].values)):
        kept = together > MAX_CONTRADICTION * alone
        yield Note(
            "board-moved",
            f"All cameras together leave {together:.2g} px (rms) of the board's corners, each "
            f"alone {alone:.2g} px: the board moved while they took their images, or a camera did "
            f"between poses. {'Lenses are those of each camera alone. ' if kept else ''}Standard "
            "errors hold that.",
        )


def _of_markers(data: xr.Dataset) -> Iterator[Note]:
    still = data["frozen"].values.astype(bool)
    if still.any():
        most = 1e3 * float(np.nanmax(data["standard_error"].values[still.any(axis=0)]))
        held = ", ".join(
            f"{name} {size:.2g} px"
            for name, size in zip(data["camera"].values, data["held_back"].values, strict=True)
            if size
        )
        yield Note(
            "held-still",
            f"{still.any(axis=0).sum()} markers hardly scatter in some camera: the video's "
            f"compression holds still what moves by less ({held}). Their deflections come out too "
            f"small, by up to {most:.2g} mm, which their standard errors hold.",
        )
    if unknown := int(np.isnan(data["deflection"].values).sum()):
        yield Note(
            "unseen-markers",
            f"{unknown} markers were seen by fewer than two cameras, or in too few frames: they "
            "have no result.",
        )


def _of_shape(data: xr.Dataset) -> Iterator[Note]:
    if (wide := float(data["in_plane_excess"])) > WIDE:
        yield Note(
            "in-plane",
            f"Markers seem to move in the structure's plane by {wide:.1f} times what the centres' "
            "scatter explains: compression, clocks or calibration are off, or the structure does "
            "not move along its normal alone. Standard errors were multiplied by that.",
        )
    growth = float(data["growth"])
    if abs(growth) > DRIFT:
        yield Note(
            "growth",
            f"The amplitude changes by {growth:+.0%} over the steady part: the shape is that of "
            "its mean.",
        )
    if int(data["ambiguous"]):
        yield Note(
            "whole-periods",
            "The cameras' starts are in doubt by whole periods. A steady vibration's shape and "
            "its phase to the force are right nevertheless.",
        )
    off = rms(data["quadrature"].values) / rms(data["deflection"].values)
    if off > 0.05:
        yield Note(
            "quadrature",
            f"A quarter of a period after the maximum {off:.0%} of the deflection is left: this "
            "is no standing wave of one mode.",
        )
    change: Array = data["without_camera"].values - data["deflection"].values
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = rms(change / data["without_deviation"].values)
    if spread > 3:
        yield Note(
            "cameras-contradict",
            f"Shapes without one of the cameras differ by {spread:.1f} times what the centres' "
            "scatter explains: calibration, clocks or centres are off by more than that scatter "
            "tells.",
        )
