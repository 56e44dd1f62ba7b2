"""Conditions of the notes at the start of a report.

Their limits and texts are in ``messages.toml``.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration import rig, uncertainty
from thesis_lib.measure.fitting.result import MAX_SCALE_ERROR, known_rms
from thesis_lib.measure.messages import NOTE_LIMITS, Note, make_note
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.response.result import MAX_BLUR, wanted_interval
from thesis_lib.studies.cubes import complex_of, iterate_slices

# Settling time of a resonance over its time constant 1 / (2πζf): to e⁻⁴, 2 %
SETTLING_TIME_CONSTANTS = 4.0


def check_shape(data: xr.Dataset) -> list[Note]:
    """Return the notes on the shape at one frequency."""
    return [*_check_frequency(data), *_check_cameras(data), *_check_fit(data)]


def _check_frequency(data: xr.Dataset) -> Iterator[Note]:
    used, given = float(data["frequency"]), float(data["frequency_given"])
    seconds = float((data["frames"] / data["frame_rate"]).max())
    if abs(used - given) * seconds > NOTE_LIMITS["frequency-replaced"]:
        std = float(data["frequency_deviation"])
        yield make_note("frequency-replaced", given=given, used=used, std=std)
    other, ratio = float(data["other_frequency"]), float(data["other_amplitude"])
    explained = float(data["explained"])
    wrong = {
        "frequency-wrong": ratio > 1,
        "other-tone": ratio > NOTE_LIMITS["other-tone"],
        "little-explained": explained < NOTE_LIMITS["little-explained"],
    }
    if code := next((code for code, is_wrong in wrong.items() if is_wrong), None):
        yield make_note(code, used=used, explained=explained, other=other, ratio=ratio)
    lags = dict(zip(data["alias"].values, data["alias_lag"].values, strict=True))
    own = lags.pop(data["alias"].values[0])
    better = {f: lag for f, lag in lags.items() if lag < own / 3}
    rivals = ", ".join(f"{f:.6g} Hz ({lag:.0f}°)" for f, lag in sorted(lags.items()))
    if own > NOTE_LIMITS["maybe-alias"] and better:
        best, lag = min(better.items(), key=lambda item: item[1])
        yield make_note("maybe-alias", used=used, best=best, own=own, lag=lag, rivals=rivals)
    elif used > 0.5 * float(data["frame_rate"].min()) and lags:
        plain = ", ".join(f"{f:.6g} Hz" for f in lags)
        unchecked = bool(np.isnan(own))
        variant, rivals = ("unchecked", plain) if unchecked else ("", rivals)
        yield make_note("alike", variant, used=used, own=own, rivals=rivals)


def _check_cameras(data: xr.Dataset) -> Iterator[Note]:
    yield from _check_repeats(data)
    first = str(data["camera"].values[0])
    for one in iterate_slices(data, "camera"):
        name, lost = str(one["camera"].values), float(one["missing"].mean())
        rate, given = float(one["frame_rate"]), float(one["frame_rate_given"])
        if abs(rate / given - 1) > NOTE_LIMITS["file-rate"]:
            yield make_note("file-rate", name=name, rate=rate, given=given)
        if (uneven := float(one["uneven"])) > NOTE_LIMITS["uneven-frames"] / rate:
            yield make_note("uneven-frames", name=name, uneven_ms=1e3 * uneven)
        if lost > NOTE_LIMITS["markers-lost"]:
            yield make_note("markers-lost", name=name, lost=lost)
        if jump := float(one["jump"]):
            yield make_note("camera-jumped", name=name, jump=jump, time=float(one["jump_time"]))
        late = float(one["lag"]) if one.attrs.get("sound") != "none" else 0.0
        pace = float(one["pace"]) if one["corrected"] else 0.0
        errors = float(one["lag_deviation"]), float(one["pace_deviation"])
        yield from _check_clock(name, first, late, pace, errors)
        if (misfit := float(one["rest_misfit"])) > NOTE_LIMITS["rest-misfit"]:
            yield make_note("rest-misfit", name=name, misfit=misfit)
    if not np.isfinite(data.get("focal_deviation", 0.0)).all():
        yield make_note("calibration-untold")
    yield from check_board(data)
    if 0 < (poses := int(data.get("board_poses", 0))) < uncertainty.MIN_JACKKNIFE_POSES:
        yield make_note("few-poses", poses=poses, enough=uncertainty.MIN_JACKKNIFE_POSES)
    off = float(data["grid_scale"]) - 1
    if abs(off) > MAX_SCALE_ERROR:
        yield make_note("grid-scale", off=off)


def _check_repeats(data: xr.Dataset) -> Iterator[Note]:
    for line in data.attrs.get("repeats", "").splitlines():
        yield make_note("repeated-frames", line=line)


def _check_clock(
    name: str, first: str, late: float, pace: float, errors: Sequence[float] = (np.nan, np.nan)
) -> Iterator[Note]:
    """Report corrections of a camera's start in s and of its relative pace, with their errors."""
    late_error, pace_error = (
        "" if np.isnan(value) else f" ± {float(f'{value:.1g}'):,g}"
        for value in np.multiply(errors, (1e3, 1e6))
    )
    if late:
        way, how = "later" if late > 0 else "earlier", f"{1e3 * abs(late):.2g}{late_error}"
        yield make_note("start-by-pictures", name=name, how=how, way=way)
    if pace:
        yield note_pace(name, first, pace, pace_error)


def note_pace(name: str, first: str, pace: float, error: str = "") -> Note:
    """Return the note on a clock that runs faster than the first camera's by a relative pace."""
    way = "fast" if pace > 0 else "slow"
    how = f"{float(f'{1e6 * abs(pace):.3g}'):,g}{error} ppm {way} compared with that of {first}"
    code = "frames-lost" if abs(pace) > NOTE_LIMITS["frames-lost"] else "clock-drift"
    return make_note(code, name=name, how=how)


def check_board(data: xr.Dataset) -> Iterator[Note]:
    """Compare corner residuals of the joint calibration with those of each camera alone."""
    if "single_rms" not in data:  # an imported calibration
        return
    together = float(data.get("reprojection_rms", np.nan))
    if together > NOTE_LIMITS["board-moved"] * (alone := known_rms(data["single_rms"].values)):
        kept = together > rig.MAX_CONTRADICTION * alone
        lenses = "Lenses are those of each camera alone. " if kept else ""
        yield make_note("board-moved", together=together, alone=alone, lenses=lenses)


def _check_fit(data: xr.Dataset) -> Iterator[Note]:
    still = data["frozen"].values.astype(bool)
    if still.any():
        held = zip(data["camera"].values, data["held_back"].values, strict=True)
        yield make_note(
            "held-still",
            count=still.any(axis=0).sum(),
            held=", ".join(f"{name} {size:.2g} px" for name, size in held if size),
            most_mm=1e3 * float(np.nanmax(data["standard_error"].values[still.any(axis=0)])),
        )
    if unknown := int(np.isnan(data["deflection"].values).sum()):
        yield make_note("unseen-markers", count=unknown)
    if (excess := float(data["in_plane_excess"])) > NOTE_LIMITS["in-plane"]:
        yield make_note("in-plane", excess=excess)
    if abs(growth := float(data["growth"])) > NOTE_LIMITS["growth"]:
        yield make_note("growth", growth=growth)
    if int(data["ambiguous"]):
        yield make_note("whole-periods")
    off = known_rms(data["quadrature"].values) / known_rms(data["deflection"].values)
    if off > NOTE_LIMITS["quadrature"]:
        yield make_note("quadrature", off=off)
    change: Array = data["without_camera"].values - data["deflection"].values
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = known_rms(change / data["without_deviation"].values)
    if spread > NOTE_LIMITS["cameras-contradict"]:
        yield make_note("cameras-contradict", spread=spread)


def check_modes(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """Yield the notes on several modes."""
    yield from _check_repeats(data)
    hertz, asked = data["frequency"].values, manifest.excitation.modes.count
    seconds = float(np.diff(data["window"].values)[0])
    if asked and len(hertz) < asked:
        yield make_note("fewer-modes", found=len(hertz), asked=asked)
    for k, f in enumerate(hertz):
        one = data.isel(mode=k)
        own, other = float(one["out_of_step"]), float(one["rival_out_of_step"])
        if other < 3 * own:
            yield make_note("mode-alias", hertz=f, rival=float(one["rival"]), own=own, other=other)
        if (ratio := float(one["beside"])) > NOTE_LIMITS["left-near-mode"]:
            film = {"resolution": 1 / seconds, "seconds": seconds}
            yield make_note("left-near-mode", hertz=f, ratio=ratio, **film)
        error, zeta = float(one["damping_deviation"]), float(one["damping"])
        if zeta and error > NOTE_LIMITS["damping-unsure"] * abs(zeta):
            yield make_note("damping-unsure", hertz=f, share=error / abs(zeta))
    mac = np.triu(data["assurance"].values, 1)
    for i, j in np.argwhere(mac > NOTE_LIMITS["shapes-alike"]):
        yield make_note("shapes-alike", first=hertz[i], second=hertz[j], mac=mac[i, j])
    first = str(data["camera"].values[0])
    for k, name in enumerate(map(str, data["camera"].values)):
        if (lost := float(data["missing"][k].mean())) > NOTE_LIMITS["markers-lost"]:
            yield make_note("markers-lost", name=name, lost=lost)
        if (strays := float(data["left_out"][k])) > NOTE_LIMITS["markers-strayed"]:
            yield make_note("markers-strayed", name=name, strays=strays)
        yield from _check_clock(name, first, float(data["lag"][k]), float(data["pace"][k]))


def check_sound(data: xr.Dataset) -> Iterator[Note]:
    """Yield the notes on the radiated sound."""
    is_low = data["frequency"].values < data["no_wall_below"].values
    low = data.isel(tone=is_low & ~(data["no_wall_change"].values > 0))
    if data.attrs["wall"] != "yes" and low.sizes["tone"]:
        changes = [
            f"at {float(one['frequency']):.4g} Hz {format_no_wall_change(one)} dB"
            for one in iterate_slices(low, "tone")
        ]
        yield make_note("no-wall", changes="; ".join(changes))
    highest, step = float(data.attrs["highest"]), 1000 * float(data.attrs["spacing"])
    for one in iterate_slices(data, "tone"):
        hertz = float(one["frequency"])
        if hertz > highest:
            yield make_note("waves-too-short", hertz=hertz, step_mm=step, highest=highest)
        left, noise = float(one["left"]), float(one["left_by_noise"])
        if left > NOTE_LIMITS["surface-unknown"] * noise:
            variant = "model" if data.attrs["between"] == "model" else ""
            yield make_note("surface-unknown", variant, hertz=hertz, left=left, noise=noise)
        if hertz < NOTE_LIMITS["not-heard"]:
            yield make_note("not-heard", hertz=hertz)


def format_no_wall_change(one: xr.Dataset) -> str:
    """Format the change of a sine's power without a wall in dB, with its standard error."""
    change, std = float(one["no_wall_change"]), float(one["no_wall_change_std"])
    return f"{change:+.1f} ± {std:.2g}" if np.isfinite(change) else "not estimated"


def check_response(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """Yield the notes on receptances."""
    times, filmed = data["time"].values, tuple(data["filmed"].values)
    wanted = wanted_interval(manifest, filmed)
    recorded = wanted[1] - wanted[0]
    f, drive, many = data["frequency"].values, int(data["drive"]) - 1, int(data["segments"])
    if (covered := times[-1] - times[0]) < (1 - NOTE_LIMITS["force-short"]) * recorded:
        variant = "" if wanted == filmed else "steady"
        yield make_note("force-short", variant, covered=covered, recorded=recorded)
    at = np.array([data["x"].values[drive], data["y"].values[drive]])
    apart = 1e3 * float(np.linalg.norm(at - data["force_place"].values))
    if apart > manifest.structure.markers.diameter_mm:
        yield make_note("force-apart", apart_mm=apart, marker=drive + 1)
    if many > 1 and (averages := float(data["averages"].max())) < NOTE_LIMITS["few-averages"]:
        yield make_note("few-averages", averages=averages)
    usual = float(np.nanmedian(data["coherence"].values[drive]))
    if usual < NOTE_LIMITS["incoherent"]:
        yield make_note("incoherent", marker=drive + 1, coherence=usual)
    if (share := float(data["unknown"].mean())) > NOTE_LIMITS["deflections-lost"]:
        yield make_note("deflections-lost", share=share)
    first = str(data["camera"].values[0])
    for one in iterate_slices(data, "camera"):
        late, pace = float(one["camera_lag"]), float(one["camera_pace"])
        yield from _check_clock(str(one["camera"].values), first, late, pace)
    degrees = np.degrees(float(data["phase_deviation"].values[-1]))
    if degrees > NOTE_LIMITS["force-clock-unsure"]:
        std = 1e3 * float(data["delay_deviation"])
        yield make_note("force-clock-unsure", std_ms=std, degrees=degrees, hertz=f[-1])
    if abs(fast := float(data["pace"])) > NOTE_LIMITS["force-clock-drift"]:
        way = "fast" if fast > 0 else "slow"
        yield make_note("force-clock-drift", ppm=1e6 * abs(fast), way=way)
    if (share := float(data["beyond"])) > NOTE_LIMITS["force-too-fast"]:
        yield make_note("force-too-fast", share=share)
    yield from _check_length(data, manifest)
    if many > 1:
        yield from _check_sweep(data, manifest)


def _peak(data: xr.Dataset) -> tuple[float, float]:
    """Return the frequency in Hz of the largest rms receptance, and its value in m/N."""
    size = np.sqrt(np.nanmean(np.abs(complex_of(data, "receptance")[0]) ** 2, axis=0))
    top = int(np.argmax(size))
    return float(data["frequency"].values[top]), float(size[top])


def _check_sweep(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """Report a sweep that passes the resonance faster than this settles."""
    begin, end = data["sweep"].values
    if not np.isfinite(begin):
        return
    (top, _), zeta = _peak(data), manifest.structure.damping
    duration = float(data["sweep_duration"])
    stays = 2 * zeta * top * duration / abs(end - begin)  # in the half-power band, 2ζf wide
    needs = SETTLING_TIME_CONSTANTS / (2 * np.pi * zeta * top)
    if stays < needs:
        sweep = {"begin": begin, "end": end, "duration": duration, "factor": needs / stays}
        yield make_note("sweep-fast", hertz=top, stays=stays, needs=needs, **sweep)


def _check_length(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """Report a peak whose error by the length of the segments exceeds that by noise."""
    top, size = _peak(data)
    own = data.sel(estimator="H1", frequency=top)
    blur, error = (np.sqrt(np.nanmean(own[k].values ** 2)) for k in ("blur", "standard_error"))
    noise = np.sqrt(error**2 - blur**2)
    if not blur > noise:
        return
    known = {"hertz": top, "noise": noise / size}
    if int(data["segments"]) == 1:
        rate = 2 * np.pi * (zeta := manifest.structure.damping) * top
        known |= {"left": float(data["ringing"]), "share": blur / size, "damping": 100 * zeta}
        yield make_note("still-ringing", longer=np.log(blur / noise) / rate, **known)
        return
    seconds, share = float(data["segment"]), blur / (size + blur)
    longer = seconds * (blur / max(noise, 1e-3 * size)) ** 0.4  # blur ~ T⁻², noise ~ √T
    how = "much" if share > MAX_BLUR else f"by about {share:.1%}"
    yield make_note("segment-short", segment=seconds, how=how, longer=longer, **known)
