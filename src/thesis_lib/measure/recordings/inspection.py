"""Films looked through before anything is measured: what cannot be decoded, what repeats."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.recordings import media

SAMPLING_PX = 4  # px between the pixels of which frames are compared
#: Change from the frame before, over that of the frames around, of a frame that repeats it. What
#: compression and its noise left of repeated frames was below 0.01 (H.264, crf 17 and 26).
MAX_RELATIVE_CHANGE = 0.02
NEIGHBOUR_FRAMES = 12  # frames before and after, in both of which something must move
MIN_MOTION = 0.25  # change of those over that of all frames, below which the structure rests
MIN_SHARE, MIN_REPEATS = 0.03, 4  # repeats from which on they are reported
MIN_REGULAR_SHARE = 0.8  # of the distances between repeats that are alike, of regular ones


def inspect_film(path: Path, clock: Array, tick: Callable[[int], object] = int) -> IntArray:
    """Decode all frames of a film, and return which repeat the one before.

    Parameters
    ----------
    path : Path
        The film.
    clock : ndarray, shape (frames,)
        Times of its frames, s; only their number counts here.
    tick : callable
        Called with the number of frames done since the last call.

    Returns
    -------
    ndarray, shape (repeats,)
        Numbers of the frames.

    Raises
    ------
    MediaError
        If a frame is missing or cannot be decoded.
    """
    last: deque[Array] = deque(maxlen=4)
    steps, across = np.zeros((2, len(clock)))
    for k, image in enumerate(media.read_frames(path, stop=len(clock), clock=clock)):
        last.append(image[::SAMPLING_PX, ::SAMPLING_PX].astype(float))
        if k >= 1:
            steps[k] = np.mean(np.abs(last[-1] - last[-2]))
        if k >= 3:
            across[k - 1] = np.mean(np.abs(last[-1] - last[0]))
        tick(1)
    return find_repeats(steps, across)


def find_repeats(steps: ArrayLike, across: ArrayLike) -> IntArray:
    """Return the frames that repeat the one before, while frames around them do not.

    Parameters
    ----------
    steps : array_like, shape (frames,)
        Mean change of grey levels from the frame before.
    across : array_like, shape (frames,)
        That from two frames before to the frame after, which is small where a motion turns back
        between two frames, so that these are alike.
    """
    steps, across = np.asarray(steps, float), np.asarray(across, float)
    if len(steps) < 2 * NEIGHBOUR_FRAMES:
        return np.zeros(0, int)
    # The largest change in the frames up to each one; reversed, in those from it on.
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(steps, (NEIGHBOUR_FRAMES, NEIGHBOUR_FRAMES)), NEIGHBOUR_FRAMES + 1
    ).max(axis=1)
    around = np.minimum(windows[: len(steps)], windows[-len(steps) :])
    moving = around > max(MIN_MOTION * float(np.quantile(steps, 0.9)), 1e-9)
    same = moving & (steps <= MAX_RELATIVE_CHANGE * around)
    alone = ~np.roll(same, 1) & ~np.roll(same, -1)
    turns = same & alone & (across <= 4 * MAX_RELATIVE_CHANGE * around)  # at most 3 times the step
    repeats = np.flatnonzero(same & ~turns)
    few = len(repeats) < max(MIN_REPEATS, MIN_SHARE * np.count_nonzero(moving))
    return np.zeros(0, int) if few else repeats


def describe_repeats(name: str, repeats: IntArray) -> str:
    """Return what to say of frames that repeat, empty if none do.

    Examples
    --------
    >>> describe_repeats("A", np.arange(4, 100, 5))
    'every 5th frame of camera A repeats the one before.'
    >>> describe_repeats("A", np.flatnonzero(np.arange(100) % 4))
    'every frame of camera A is stored 4 times.'
    """
    if not len(repeats):
        return ""
    fresh = np.setdiff1d(np.arange(repeats[0] - 1, repeats[-1] + 2), repeats)
    for numbers, rare in ((repeats, True), (fresh, False)):
        steps = np.diff(numbers)
        step = int(np.median(steps)) if len(steps) else 0
        if step > 1 and np.mean(steps == step) >= MIN_REGULAR_SHARE:
            ending = {2: "nd", 3: "rd"}.get(step, "th")
            if rare:
                return f"every {step}{ending} frame of camera {name} repeats the one before."
            return f"every frame of camera {name} is stored {step} times."
    share = len(repeats) / (repeats[-1] - repeats[0] + 1)
    return f"{share:.0%} of the frames of camera {name} repeat the one before."
