"""Images, raw frames and Phantom's files against what was put into them, by their formats."""

import struct

import numpy as np
import pytest
from command import refusal, thesis

from thesis_lib.measure.recordings.media import pack_frames, read_frames, write_png
from thesis_lib.measure.recordings.media_info import frame_clock, probe_media

FRAMES = np.random.default_rng(0).integers(0, 4096, (7, 48, 64), np.uint16)  # of twelve bits
EIGHT = (FRAMES >> 4).astype(np.uint8)
CIH = """#Camera Information Header
Date : 2026/11/25
Record Rate(fps) : 12500
Total Frame : 7
Image Width : 64
Image Height : 48
Color Type : Mono
Color Bit : {bits}
EffectiveBit Depth : {depth}
EffectiveBit Side : {side}
File Format : MRaw
"""
CIHX = """binary\0rubbish<cih><recordInfo><recordRate>12500</recordRate></recordInfo>
<frameInfo><totalFrame>7</totalFrame></frameInfo><imageDataInfo>
<resolution><width>64</width><height>48</height></resolution>
<colorInfo><type>Mono</type><bit>{bits}</bit></colorInfo>
<effectiveBit><depth>{depth}</depth><side>{side}</side></effectiveBit></imageDataInfo></cih>
"""


BITS = (FRAMES.ravel()[:, None] >> np.arange(11, -1, -1)) & 1  # most significant first
RAW = {
    "8 bits": (8, 8, "Lower", EIGHT.tobytes()),
    "12 packed": (12, 12, "Lower", np.packbits(BITS.astype(np.uint8)).tobytes()),
    "16, the lower 12": (16, 12, "Lower", FRAMES.astype("<u2").tobytes()),
    "16, the higher 12": (16, 12, "Higher", (FRAMES << 4).astype("<u2").tobytes()),
}


def photron(folder, bits, depth, side, data, suffix=".cih"):
    header = {".cih": CIH, ".cihx": CIHX}[suffix].format(bits=bits, depth=depth, side=side)
    (folder / f"C1{suffix}").write_text(header, encoding="utf-8")
    (folder / "C1.mraw").write_bytes(data)
    return folder / f"C1{suffix}"


@pytest.mark.parametrize(("kind", "suffix"), [*zip(RAW, [".cih", ".cihx"] * 2, strict=True)])
def test_raw_frames_come_back_at_their_rate(tmp_path, kind, suffix):
    source, video = photron(tmp_path, *RAW[kind], suffix), tmp_path / "C1.mov"
    assert pack_frames(source, video) == (7, (64, 48))
    clock = frame_clock(video)
    np.testing.assert_allclose(clock, np.arange(7) / 12500, atol=1e-9)
    np.testing.assert_array_equal(list(read_frames(video, clock=clock)), EIGHT)
    assert not probe_media(video).has_audio


def test_pictures_are_taken_in_the_order_of_their_numbers(tmp_path):
    (tmp_path / "left").mkdir()
    for k, frame in enumerate(EIGHT):
        write_png(tmp_path / "left" / f"frame{k + 7}.png", frame[:47, :63])
    said = thesis("convert", tmp_path / "left", "--rate-hz", "240")
    assert said.out == f"{tmp_path / 'left.mov'}: 7 frames of 62 × 46 px\n"
    video = tmp_path / "left.mov"
    np.testing.assert_array_equal(list(read_frames(video)), EIGHT[:, :46, :62])
    assert probe_media(video).frame_rate == 240
    video.unlink()  # the same from inside the folder
    inside = thesis("convert", ".", "--rate-hz", "240", cwd=tmp_path / "left")
    assert inside.out == f"{video.resolve()}: 7 frames of 62 × 46 px\n"
    (tmp_path / "left" / "frame9.png").unlink()
    gap = thesis("convert", tmp_path / "left", tmp_path / "gap.mov", "--rate-hz", "240")
    assert "frame10.png follows frame8.png" in refusal(gap)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("12500", "0", "recordRate"),
        ("12500", "&x;", "C1.cihx"),
        (">7<", ">1e12<", "totalFrame"),
        (">7<", ">8<", "shorter than the 8 frames"),
        ("<bit>8", "<bit>10", "10 bits for a pixel"),
        ("<depth>8", "<depth>12", "12 of them used"),
        ("<depth>8", "<depth>7", "7 of them used"),
        (">64<", ">17000<", "sides of 2 to 16384 px"),
        ("Lower", "Weird", "side"),
        ("totalFrame", "frames", "does not say"),
    ],
)
def test_a_wrong_header_is_refused_by_its_field_in_one_line(tmp_path, old, new, said):
    source = photron(tmp_path, *RAW["8 bits"], ".cihx")
    text = source.read_text(encoding="utf-8")
    assert old in text
    source.write_text(text.replace(old, new), encoding="utf-8")
    done = thesis("convert", source)
    assert (done.status, len(done.err.splitlines())) == (2, 1)
    assert "C1." in done.err
    assert said in done.err
    assert not source.with_suffix(".mov").exists()


def test_a_folder_without_pictures_or_rate_is_refused(tmp_path):
    for what, said in [("", "no image in it"), ("none", "allowed: a folder of images")]:
        done = thesis("convert", tmp_path / what, tmp_path / "o.mov", "--rate-hz", "5")
        assert (done.status, said in done.err) == (2, True)
    write_png(tmp_path / "a.png", EIGHT[0])
    for words, said in [(["o.mov"], "give --rate-hz"), (["o.mp4", "--rate-hz", "5"], ".mov")]:
        assert said in thesis("convert", tmp_path, tmp_path / words[0], *words[1:]).err


def test_phantoms_files_are_read_as_they_are(tmp_path):
    # Header (44 bytes), bitmap header (40), setup with the rate at byte 768, places of the frames,
    # frames: an annotation of 8 bytes, then rows from the lowest up.
    rate, (n, height, width) = 12500, EIGHT.shape
    setup = bytearray(0x163C)
    struct.pack_into("<2sH", setup, 140, b"ST", len(setup))
    struct.pack_into("<I", setup, 768, rate)
    places = 84 + len(setup)
    first, size = places + 8 * n, height * width
    path = tmp_path / "fast.cine"
    path.write_bytes(
        struct.pack("<2sHHHiIiIIIIQ", b"CI", 44, 0, 1, 0, n, 0, n, 44, 84, places, 0)
        + struct.pack("<IiiHHIIiiII", 40, width, height, 1, 8, 0, size, 0, 0, 256, 256)
        + bytes(setup)
        + struct.pack(f"<{n}q", *(first + k * (8 + size) for k in range(n)))
        + b"".join(struct.pack("<II", 8, size) + frame[::-1].tobytes() for frame in EIGHT)
    )
    assert probe_media(path).frame_rate == rate
    clock = frame_clock(path)
    np.testing.assert_allclose(clock, np.arange(n) / rate, atol=1e-9)
    np.testing.assert_array_equal(list(read_frames(path, clock=clock)), EIGHT)
