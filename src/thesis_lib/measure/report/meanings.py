"""What each note of a report means, and what to do: for the report itself, and for the book."""

from __future__ import annotations

from typing import NamedTuple


class Note(NamedTuple):
    """What a reader should know before trusting a result."""

    code: str  #: Its name, under which its meaning stands
    text: str  #: One line


class Meaning(NamedTuple):
    """What a note means, and what to do."""

    says: str  #: How it begins, with dots for names and numbers
    means: str
    do: str


OF_A_SHAPE = {
    "frequency-replaced": Meaning(
        "The manifest's … Hz was replaced by … Hz",
        "The markers do not move at the frequency of the manifest, but at one near it.",
        "Nothing, if the new one is what the generator shows. Else look at the generator and at "
        "the cameras' clocks, and put `frequency_hz` right.",
    ),
    "frequency-wrong": Meaning(
        "… Hz explains … of the motion; most of it is at … Hz",
        "Most of what the markers do has another frequency than the one that was fitted.",
        "Give the frequency that is told, or `frequency_hz: null`, and measure again.",
    ),
    "other-tone": Meaning(
        "… Hz explains … of the motion; another tone, at … Hz",
        "Something else vibrates, too. It is left out of the shape, but adds to its scatter.",
        "If it is nearly the same frequency, the vibration grew or died away: give a later "
        "`steady_s`. Else find what it is: a fan, a second mode that still rings, the stand of a "
        "camera. To measure both, use `kind: tones`.",
    ),
    "little-explained": Meaning(
        "… Hz explains only … of the motion, and no other tone much of the rest",
        "Either the frequency is so wrong that markers were taken for their neighbours, or the "
        "motion is lost in noise.",
        "Look at the first frames and at the folded motion in the report. Check `frequency_hz`; "
        "vibrate more, come nearer, or film longer.",
    ),
    "maybe-alias": Meaning(
        "… Hz may be an alias of … Hz: with it the cameras are",
        "Frames cannot tell these frequencies apart. Cameras that start at different times can: "
        "with the wrong one they seem to be out of step, by the degrees that are told.",
        "Give the other frequency, and see whether the cameras agree. If in doubt, film at "
        "another frame rate.",
    ),
    "alike": Meaning(
        "These frames show alike …",
        "Above half of the frame rate several frequencies look the same. That it is the one of the "
        "manifest rests on your word.",
        "Nothing, if you know the frequency from the generator. Else film faster, or with cameras "
        "of unlike frame rates.",
    ),
    "file-rate": Meaning(
        "Camera …'s file has … frames per second, the manifest",
        "The file is right; each frame counts at its own time stamp.",
        "Nothing. If the film plays more slowly than it was taken, give `captured_hz`.",
    ),
    "uneven-frames": Meaning(
        "Camera …'s frames come unevenly",
        "Phones do so when light is short. Each frame counts at its own time stamp.",
        "Nothing; more light makes frames even.",
    ),
    "markers-lost": Meaning(
        "Camera … lost … of its marker images",
        "Markers were hidden, left the picture, or moved too fast to be followed. Points without "
        "them rest on fewer cameras.",
        "Look at the first frames in the report, at the share that each camera lost, and at "
        "`tracked.mp4`. Move the camera, or vibrate less.",
    ),
    "camera-jumped": Meaning(
        "All that camera … sees jumped by … px at … s",
        "The camera was touched at that second, or the structure slipped.",
        "End `steady_s` before it, or film again.",
    ),
    "repeated-frames": Meaning(
        "Frames repeat: …",
        "The video holds fewer pictures than its frame rate says: it was converted from another "
        "rate, the camera could not keep up, or the compression left frames as they were. Frames "
        "then count at times at which they were not taken, so that clocks seem to drift and other "
        "frequencies to appear.",
        "Take the file as the camera wrote it, at a frame rate that the camera can keep up; turn "
        "automatic frame rates off. Without the repeated frames: `thesis pack` on the pictures, "
        "at their own rate.",
    ),
    "frames-lost": Meaning(
        "Camera …'s clock seems to run …: more than any clock",
        "Clocks of cameras agree to 0.01 %, the worst to 0.05 %. Frames that were lost or repeated "
        "without their time stamps saying so look like a clock that runs so much faster or slower, "
        "and so does a video whose rate was rounded, as 59.94 to 60.",
        "Look at how frames repeat, and take the file as the camera wrote it. If its rate was "
        "rounded, nothing: the times were corrected.",
    ),
    "clock-drift": Meaning(
        "Camera …'s clock runs …",
        "Each camera sees the vibration's frequency by its own clock. This one's differs, and its "
        "times were corrected.",
        "Nothing: cheap clocks are off by some tens of ppm. Hundreds tell of a film that was "
        "converted; take the file as the camera wrote it.",
    ),
    "start-by-pictures": Meaning(
        "By the pictures camera … started …",
        "Sound takes 2.9 ms for a metre, and sound and picture of a camera may not start together. "
        "What moves along the normal tells each camera's phase, so the pictures decide, to within "
        "whole periods.",
        "Nothing. More than a few hundredths of a second tell of a phone whose sound is late: clap "
        "in view of all cameras, and compare.",
    ),
    "rest-misfit": Meaning(
        "Camera … sees the markers at rest … px from where",
        "This camera, or another one, moved, zoomed or cropped after the board was filmed.",
        "Film board and structure again with focus, zoom and mode locked, and leave the cameras "
        "alone in between.",
    ),
    "calibration-untold": Meaning(
        "The calibration that was reused does not tell how exact it is",
        "It is from another program. Errors of its lenses and places turn and stretch the shape as "
        "a whole, by an unknown amount.",
        "Reuse the folder of an earlier measurement, or give pictures of the board.",
    ),
    "board-moved": Meaning(
        "All cameras together leave … px (rms) of the board's corners, each alone",
        "Each camera sees the board as a board, but no one place of it fits all cameras: it moved "
        "while cameras that are out of step took their images, or a camera was touched between two "
        "poses. If the residuals differ by more than three times, lenses are calibrated camera by "
        "camera, which such a motion does not disturb; the cameras' places suffer from it.",
        "Calibrate again with the board at rest in each pose: lean or clamp it, wait a second, and "
        "then take the images. Do not touch the cameras.",
    ),
    "few-poses": Meaning(
        "The board was used in … poses, which is few",
        "How far the cameras may be off is seen by leaving out one pose of the board after the "
        "other. Of fewer than five none can be spared: each corner then counts as a witness of its "
        "own, and the deviations are widened by as much as the poses contradict each other.",
        "Film the board in more poses, tilted all ways: five at least, ten are better.",
    ),
    "grid-scale": Meaning(
        "The markers' grid comes out … in size",
        "Size comes from the board's tiles. By them the markers are farther apart, or closer, than "
        "the manifest says.",
        "Measure across many tiles and many markers with a good ruler, and put `tile_mm` and "
        "`spacing_mm` right. If both were right, a camera zoomed or cropped.",
    ),
    "held-still": Meaning(
        "… markers hardly scatter in some camera",
        "The video was compressed so much that small motions were swallowed there. How small is "
        "read from the markers beside them that do move. Standard errors hold what may be lost.",
        "Film at a higher bit rate, or without loss; or vibrate more.",
    ),
    "unseen-markers": Meaning(
        "… markers were seen by fewer than two cameras, or in too few frames",
        "Two cameras are needed to place a marker in space. These are left out.",
        "If they matter, move a camera so that two see them.",
    ),
    "in-plane": Meaning(
        "Markers seem to move in the structure's plane by …",
        "A structure that bends moves along its normal. What is left in its plane is an error of "
        "compression, clocks or calibration, or the structure does move so. Standard errors are "
        "multiplied by that factor. This check needs two cameras only.",
        "Look for other notes that name a camera. Else take more and better pictures of the board, "
        "and a higher bit rate.",
    ),
    "growth": Meaning(
        "The amplitude changes by … over the steady part",
        "The vibration grew or died away in the part that was fitted, or that part holds some of "
        "the rest. The largest deflection is then too small.",
        "Give a later or shorter `steady_s`, or wait longer before filming.",
    ),
    "whole-periods": Meaning(
        "The cameras' starts are in doubt by whole periods",
        "The sound had nothing but a steady tone. The shape is right as long as the vibration is "
        "steady.",
        "To be sure, let the sound hold the start of the vibration, or clap.",
    ),
    "quadrature": Meaning(
        "A quarter of a period after the maximum … of the deflection is left",
        "Several modes move at once, or the structure carries a travelling wave, or the clocks of "
        "the cameras are wrong.",
        "Drive nearer to the resonance of one mode; compare `quadrature` in the results.",
    ),
    "cameras-contradict": Meaning(
        "Shapes without one of the cameras differ by …",
        "The cameras contradict each other. Usual reasons: a camera that was touched after its "
        "calibration, a clock that is off, a rolling shutter, compression.",
        "`without_camera` in `measured.nc` tells whose absence changes most. Give `readout_s` if "
        "the shutter rolls; else film again, or leave that camera out of the manifest.",
    ),
}
"""Of one tone; some of them of several modes, too."""
OF_MODES = {
    "markers-strayed": Meaning(
        "… of camera …'s marker images move unlike those beside them",
        "Markers were taken for their neighbours. Where many at once are, what is left of them "
        "may spoil damping and shapes, beyond the errors that are told.",
        "Look at the shapes, and whether frequencies and damping hold if a later `steady_s` is "
        "fitted. Tap more gently, film faster, or put rows of markers further apart.",
    ),
    "fewer-modes": Meaning(
        "… of the … modes that are asked for stand out of the noise",
        "The other modes moved too little to be told from noise.",
        "Tap or drive harder or elsewhere, film nearer, or ask for fewer.",
    ),
    "mode-alias": Meaning(
        "… Hz may be an alias of … Hz: cameras are",
        "Frames show both frequencies alike, and the cameras are not enough out of step to tell "
        "which one it is.",
        "Film with unlike frame rates, or narrow `from_hz` and `to_hz`.",
    ),
    "left-near-mode": Meaning(
        "Near … Hz … times the noise is left",
        "Another mode lies so close that the film is too short to tell both, or the vibration "
        "changed while it was filmed.",
        "Film longer, or end `steady_s` before it changes.",
    ),
    "damping-unsure": Meaning(
        "The damping at … Hz is known to … only",
        "The mode is weak, or the film too short for it to die away.",
        "Film longer or nearer, or tap where this mode moves most.",
    ),
    "shapes-alike": Meaning(
        "The shapes at … and … Hz look alike at these markers",
        "Where the markers are, the two modes move alike, so their names may be exchanged.",
        "Add markers where they differ, as between those there are.",
    ),
}
"""Of several modes alone."""
OF_SOUND = {
    "no-wall": Meaning(
        "Without a wall the structure radiates less than pressures, fields and powers in a rigid "
        "wall say",
        "All sound is computed as if the structure lay in a rigid wall that has no end. Without "
        "one, air flows around its edges instead of being compressed, as long as sound waves are "
        "longer than its flexural waves, or than twice its narrower side. The change is estimated "
        "for a thin structure that nothing surrounds.",
        "If it lies in a wall, give `wall: yes` under `radiation`. If it does not, give "
        "`wall: no`: the power without one then comes first. Pressures and fields stay those in a "
        "wall.",
    ),
    "waves-too-short": Meaning(
        "At … Hz flexural waves of the manifest's material are shorter than two spacings",
        "Between markers the structure may bend as no marker tells.",
        "Put markers closer, or film lower frequencies.",
    ),
    "surface-unknown": Meaning(
        "At … Hz … … of the markers' motion, noise explains",
        "The surface that was laid through the markers misses them by more than noise does, so "
        "that it is no better known between them. Standard errors do not hold that.",
        "Add markers; check the edges and the material in the manifest.",
    ),
    "not-heard": Meaning(
        "… Hz is below what is heard",
        "Nobody hears so low a tone.",
        "Nothing; the sound files hold it nevertheless.",
    ),
}
"""Of what is radiated."""
OF_FORCE = {
    "force-short": Meaning(
        "The force covers … of the … s that all cameras recorded",
        "The force's file begins later or ends earlier than the film. What has no force is left "
        "out.",
        "Nothing, if what was meant to be measured lies within. Else start the sound card first "
        "and stop it last.",
    ),
    "force-apart": Meaning(
        "The force acts … mm from marker …, the nearest",
        "A receptance at the drive point is that of the point itself. The nearest marker moves "
        "otherwise, the more so at high frequencies.",
        "Put a marker where the force acts, on the other side if need be, or put `at_mm` right.",
    ),
    "deflections-lost": Meaning(
        "In … of the time a marker's deflection is not known",
        "Fewer than two cameras saw it, or it seemed to move along the surface, as a marker does "
        "that was taken for its neighbour. Its curves rest on the other segments.",
        "A few in a hundred do no harm. Else drive more gently, film faster, or move a camera.",
    ),
    "few-averages": Meaning(
        "The curves rest on … averages",
        "Noise is told from motion by how much segments of the recording agree. A few segments "
        "agree by chance.",
        "Record longer, or take a shorter `force.segment_s`.",
    ),
    "incoherent": Meaning(
        "Half of the lines of marker … have a coherence below …",
        "Half of what the marker does, or more, does not follow the force: noise of the centres, "
        "or something else that moves the structure.",
        "Drive harder, film nearer, or look for what else moves it.",
    ),
    "force-clock-unsure": Meaning(
        "The force's clock is known to … ms",
        "A time that is off turns phases in proportion to the frequency.",
        "Record a sound that the sound card and all cameras hear, as claps.",
    ),
    "force-clock-drift": Meaning(
        "The force's clock runs … ppm",
        "The sound card and the first camera count seconds of unlike length; the force's times "
        "were corrected.",
        "Nothing: some tens of ppm are usual.",
    ),
    "force-too-fast": Meaning(
        "… of the force's power lies above half of the lowest frame rate",
        "Frames show such motion at other frequencies, where it spoils the curves.",
        "Filter the force before it drives the shaker, strike with a softer tip, or film faster.",
    ),
    "still-ringing": Meaning(
        "At the end the structure still moves by … of its most",
        "One segment holds the answer to the force as a whole only if it ends at rest.",
        "Film until it is at rest.",
    ),
    "segment-short": Meaning(
        "Segments of … s lower the peak at … Hz",
        "A short segment has few lines, and adds to each a part of its neighbours. By the curve "
        "itself, this makes the peak lower by more than it is uncertain by noise.",
        "Take the `force.segment_s` that is told, or record from rest to rest and take it whole.",
    ),
    "sweep-fast": Meaning(
        "The sweep from … to … Hz in … s stays … s in the resonance",
        "A resonance needs time to answer. One that is passed too fast comes out too low and too "
        "wide.",
        "Sweep as much more slowly as is told; or film until all is at rest, and take "
        "`segment_s: whole`.",
    ),
}
"""Of motion over a force."""
MEANINGS = OF_A_SHAPE | OF_MODES | OF_SOUND | OF_FORCE
