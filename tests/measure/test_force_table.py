"""A force's table, as programs and people write it, is read as what it says, or refused."""

import numpy as np
import pytest
from refused import line_of

from thesis_lib.measure.recordings.force_table import ForceError, read_force_table

COUNT = 200
TIMES = np.arange(COUNT) * 0.01
FORCES = 12.5 * np.sin(7 * TIMES)
OTHERS = 3 * np.cos(TIMES)
NUMBERS = np.arange(COUNT)


def lines(columns, separator=",", decimal=".", digits=4, quote=""):
    """Rows of columns; whole numbers and texts as they are."""

    def cell(x):
        text = f"{x:.{digits}f}" if isinstance(x, float) else str(x)
        return quote + text.replace(".", decimal) + quote

    return "\n".join(
        separator.join(map(cell, row))
        for row in zip(*(list(np.asarray(c).tolist()) for c in columns), strict=True)
    )


BOTH = [TIMES, FORCES]
GERMAN = lines(BOTH, ";", ",")
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\nChannels\t1\t\n"
    "Samples\t200\t\nX0\t0.0000E+0\t\n***End_of_Header***\t\nX_Value\tForce\tComment\n"
)
WRITTEN = {
    "points": "time,force\n" + lines(BOTH),
    "no header": lines(BOTH),
    "German, three digits": "Zeit;Kraft\n" + lines(BOTH, ";", ",", 3),
    "French": "Temps (s);Effort (N)\n" + GERMAN,
    "Excel": "sep=;\nX (s);Kanal 1 (kN)\n" + lines([TIMES, FORCES / 1000], ";", ",", 7),
    "no header, the force first": lines(BOTH[::-1]),
    "units in a line of their own": "Zeit;Kraft\nms;kN\n"
    + lines([1000 * TIMES, FORCES / 1000], ";", ",", 7),
    "tabs, German": "Zeit\tKraft\n" + lines(BOTH, "\t", ","),
    "spaces": "time force\n   " + lines(BOTH, "   ").replace("\n", "\n   "),
    "quotes and decimal commas": '"Zeit","Kraft"\n' + lines(BOTH, ",", ",", quote='"'),
    "comments": "# made by X\n% rate, 100\ntime,force\n" + lines(BOTH),
    "names in a comment": "# time 1 ms, force 2 kN\n# time_ms, force_kN\n"
    + lines([1000 * TIMES, FORCES / 1000], " ", digits=7),
    "lines of header": "Device: NI 9234\nDate;12.03.2024\nRate [Hz];100\n\n"
    "Nr.;Time [s];Force [N];Acc [m/s²]\n"
    + lines([NUMBERS + 1, TIMES, FORCES, OTHERS], ";", ","),
    "LabVIEW": LABVIEW + lines([*BOTH, [""] * COUNT], "\t"),
    "MATLAB": "Var1,Var2\n" + lines(BOTH, digits=15),
    "a data frame": ",time,force\n" + lines([NUMBERS, *BOTH]),
    "other order": "accel,force,time\n" + lines([OTHERS, FORCES, TIMES]),
    "names with units": "time_ms,force_kN\n" + lines([1000 * TIMES, FORCES / 1000], digits=7),
    "separators at the end": "time;force;\n" + GERMAN.replace("\n", ";\n") + ";",
    "thousands": "time;force in mN\n"
    + "\n".join(f"{t:.3f};{1000 * f:,.2f}" for t, f in zip(TIMES, FORCES, strict=True)),
    "time of day": "Time (h:m:s),Force (N)\n"
    + "\n".join(f"10:00:{t:06.3f},{f:.4f}" for t, f in zip(TIMES, FORCES, strict=True)),
}  # fmt: skip


@pytest.mark.parametrize("name", WRITTEN)
def test_a_table_is_read_as_it_is_written(conforms, tmp_path, name):
    (tmp_path / "force.csv").write_bytes(WRITTEN[name].encode())
    times, newtons, _ = read_force_table(tmp_path / "force.csv")
    digits = 5e-4 if "digits" in name else 5e-5
    conforms.closed_form(times, TIMES, atol=1e-9)
    conforms.closed_form(newtons, FORCES, atol=1.01 * digits)


@pytest.mark.parametrize(
    ("code", "end"),
    [("utf-8-sig", "\n"), ("utf-16", "\r\n"), ("utf-8", "\r"), ("cp1252", "\n")],
)
def test_any_code_and_end_of_line_will_do(conforms, tmp_path, code, end):
    text = ("Zeit [s];Kräfte [N]\n" + GERMAN).replace("\n", end)
    (tmp_path / "force.csv").write_bytes(text.encode(code))
    _, newtons, source = read_force_table(tmp_path / "force.csv")
    conforms.closed_form(newtons, FORCES, atol=1e-4)
    assert source == "time from column 1 (Zeit) in s, force from column 2 (Kräfte) in N"


@pytest.mark.parametrize(
    ("head", "second", "newton"),
    [
        ("time..s.,load (lb)", 1.0, 4.4482216152605),
        ("time_h,load-kg", 3600.0, 9.80665),
        ("t [d],Kraft in daN", 86400.0, 10.0),
        ("time,force\ns,cN", 1.0, 0.01),
        ("min,kips", 60.0, 4448.2216152605),
        ("s,kN\ntime,force", 1.0, 1e3),
        ("s,force (µN)", 1.0, 1e-6),
        ("s,force (μN)", 1.0, 1e-6),
        ("s,force (ch 1)", 1.0, 1.0),
        ("# time (msec.),force_grams", 1e-3, 9.80665e-3),
        ("time,F_h", 1.0, 1.0),
    ],
)
def test_a_unit_counts_as_what_it_is(conforms, tmp_path, head, second, newton):
    (tmp_path / "force.csv").write_text(f"{head}\n{lines(BOTH)}", encoding="utf-8")
    times, newtons, _ = read_force_table(tmp_path / "force.csv")
    conforms.closed_form(times, second * np.round(TIMES, 4), rtol=1e-12)
    conforms.closed_form(newtons, newton * np.round(FORCES, 4), rtol=1e-12)


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_three_decimals_are_no_thousands(conforms, tmp_path, separator):
    rows = lines([1 + np.round(NUMBERS / 700, 3), 20 + FORCES], separator, digits=3)
    (tmp_path / "force.csv").write_text(f"time_s{separator}force_N\n{rows}", encoding="utf-8")
    conforms.closed_form(read_force_table(tmp_path / "force.csv")[1], 20 + FORCES, atol=6e-4)


@pytest.mark.parametrize("step_us", [5, 20])
def test_dates_are_as_exact_as_times_of_day(conforms, tmp_path, step_us):
    micros = 999_000 + step_us * NUMBERS  # from shortly before midnight, over it
    clocks = [f"2024-02-{28 + m // 10**6}T{'23:59:59' if m < 10**6 else '00:00:00'}.{m % 10**6:06d}"
              for m in micros]  # fmt: skip
    (tmp_path / "force.csv").write_text("time,force\n" + lines([clocks, FORCES]), encoding="utf-8")
    times, _, _ = read_force_table(tmp_path / "force.csv")
    conforms.closed_form(times, 1e-6 * step_us * NUMBERS, atol=1e-10)


REFUSED = {
    "an index and a force": ("i,force\n" + lines([NUMBERS, FORCES]), "the time"),
    "a counter": ("time_s,Frame\n" + lines([TIMES, NUMBERS]), "no column is clearly the force"),
    "two forces": ("time,force 1,force 2\n" + lines([*BOTH, OTHERS]), "several columns may be"),
    "three columns unnamed": (lines([*BOTH, OTHERS]), "no column is clearly"),
    "commas for both": ("Zeit,Kraft\n" + lines(BOTH, ",", ","), "commas"),
    "milliseconds unsaid": ("time,force\n" + lines([1000 * TIMES, FORCES]), "have no unit"),
    "volts": ("time (s),force (V)\n" + lines(BOTH), "in V, allowed: N"),
    "counts": ("time (s),force counts\n" + lines(BOTH), "in counts, allowed: N"),
    "an unknown unit": ("time_s,force [oz]\n" + lines(BOTH), "in oz, allowed: N, mN, kN, lbf"),
    "an unknown unit of time": ("time (fortnight),force_N\n" + lines(BOTH), "allowed: s, ms, µs"),
    "one known unit of two": ("time,force\ns,oz\n" + lines(BOTH), "in oz, allowed: N, mN"),
    "a gap": ("time,force\n" + lines(BOTH).replace("0.5000,", "0.5000,NaN,"), "no number"),
    "lost rows": (lines([np.delete(x, range(70, 73)) for x in BOTH]), "line 71: 0.04 s after"),
    "words": ("a text\nof some\nlines\n", "not a time and a force"),
    "back in time": ("time,force\n" + lines([TIMES % 1.5, FORCES]), "after the line before"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_in_doubt_is_refused_in_one_line_with_an_example(tmp_path, name):
    text, words = REFUSED[name]
    (tmp_path / "force.csv").write_text(text, encoding="utf-8")
    line = line_of(ForceError, read_force_table, tmp_path / "force.csv")
    assert words in line
    assert "allowed: " in line
