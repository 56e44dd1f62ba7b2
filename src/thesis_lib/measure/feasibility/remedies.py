"""What to do about each warning before measuring, and about what a manifest leaves open."""

from __future__ import annotations

from thesis_lib.measure.feasibility.limits import THRESHOLDS

REMEDIES: dict[str, dict[str, str]] = {
    "Time": {
        "short-rest": "Start all cameras, and let nothing move for a second or two.",
        "few-rest-frames": "Lengthen the rest: the structure's frame comes from its mean.",
        "few-frames": "Lengthen the steady part.",
        "few-periods": "Lengthen the steady part.",
        "steady-at-rest": "Let `steady_s` begin when the vibration has settled.",
    },
    "Frame rate": {
        "undersampled": "Film faster; or set `undersampled: true` if you know the frequency from "
        "elsewhere, as from the generator.",
        "near-nyquist": "Film faster, or record long: the fit of all frames bears it, single "
        "frames do not.",
        "few-samples": "Film faster if you can. Else the fit leaves the second harmonic out.",
        "alias": "Take the frequency from the generator, to as many digits as the warning asks "
        "for; or shorten the steady part.",
        "alias-edge": "Change the frame rate or the frequency a little, or record longer.",
        "higher-modes": "Begin gently, and let the steady part begin when what rings has died "
        "away; or film faster.",
    },
    "Exposure and lens": {
        "long-exposure": "Shorten the exposure and add light. The fit puts the loss right, but not "
        "the noise that grows with it.",
        "motion-blur": "Shorten the exposure and add light, or vibrate less.",
        "depth-of-field": "Close the aperture and add light, or go farther away.",
        "too-near": "One of distance and focal length is wrong: put it right.",
    },
    "View": {
        "coarse": "Go nearer, or take more pixels, a longer lens or larger markers.",
        "foreshortened": "Raise the camera, go nearer, or take larger markers.",
        "crowded-markers": "Raise the camera, go nearer, or leave more room between markers.",
        "small-motion": "Go nearer, film with more pixels or a longer lens, or vibrate more. A "
        "film without loss shows a tenth of that as well.",
        "out-of-view": "Go farther away or take a shorter lens. If all markers are seen and only "
        "corners are cut off, give `corners_px`.",
        "shallow-view": "Raise the camera.",
        "steep-view": "Lower the camera: seen from above, deflection does not move an image.",
        "large-move": "Let the motion grow over some periods, film faster, or leave more room "
        "between markers.",
    },
    "All cameras together": {
        "lost-markers": "Move or turn cameras until two see each marker.",
        "same-line": "Move one of the two cameras: from one place they tell the same.",
        "weak-markers": "Let cameras on other sides see these markers, too.",
        "below-noise": "Go nearer, take more pixels, record longer, or vibrate more.",
    },
}
"""By what they are about, then by code."""

UNCHECKED = {
    "… of camera…: give …": "Without a lens and a place of that camera nothing can be said of its "
    "view. The fields serve this check alone: a tape measure and the phone's data sheet will do.",
    "frame rate, exposure, blur and movement: give excitation.frequency_hz": "With "
    "`frequency_hz: null` the recordings will tell it; give about what you expect for the check.",
    "blur, movement and whole pixels: give excitation.amplitude_mm": "Give the deflection that you "
    "expect at its largest; a ruler beside the structure tells it well enough.",
    "length of the steady part, taken as … s: give excitation.steady_s": "Give from when to when "
    "you mean to film the steady motion.",
    "a clap: no field tells whether every sound track has one": "Listen to each film before you "
    "take anything down.",
    'natural frequencies: give structure.kind "beam" or "plate" if it is one': "Of any other "
    "flat structure none are known.",
}
"""Lines that tell what was not checked, by how they read, with dots for what is put in."""

NEW = {
    "missing: … has no sound, which tells when the camera started": "Switch the microphone on and "
    "film again. If the vibration never changes, no sound is needed: `-p excitation.sound=none`.",
    "missing: pictures of the board by …, at least …, better …, in …": "Put them into that folder. "
    "If they lie elsewhere, name the folder after the video, or give `shots` in the manifest.",
    "missing: …, no such file in": "Put the file that `calibration`, `force` or `truth` names "
    "there, or put its name right in the manifest.",
    "missing: as many pictures of the board by every camera": "Delete what shows no board, so "
    "that the k-th picture of each camera shows the same pose. Where one camera has none of a "
    "pose, list the names in `shots`, with `null` in its place.",
    "missing: corners_px of …, which tell how the structure lies": "Open that page in a "
    "browser, click the four corners in the same order for every camera, and put its lines into "
    "the manifest. A hole in the structure, `hole_mm`, does instead.",
    "passed over: …, raw frames": "Make a video of them by the command in that line.",
    "passed over: …, which is no video that can be read": "Nothing, if it is none; else convert "
    "it without loss, as to Matroska.",
    "… plays at … frames per second and says that it was taken at …": "Nothing, but set "
    "`excitation.sound: none`; or write the film at its true rate, `thesis pack FILM --rate-hz`.",
    "not given, so assumed: -p …": "Put the line right in the manifest, where it is marked "
    "`CHECK`.",
}
"""Lines of ``thesis measure --new``, likewise."""


def reason_of(code: str) -> str:
    """Why the limit of a warning is where it is, as a sentence."""
    reason = THRESHOLDS[code].reason
    return f"{reason[:1].upper()}{reason[1:]}."


def remedy_of(code: str) -> str:
    """What to do about a warning."""
    return next(remedies[code] for remedies in REMEDIES.values() if code in remedies)
