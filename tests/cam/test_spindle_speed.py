"""The speed of the spindle in a job file: commanded where the controller has an output for it, else told in its line.

A converter of 24000 rev/min at 10 V takes S in 255ths: round(255 S / 24000) of the iMC's port 4, the whole part of
256 S / 24000, at most 255, of the GMI99's safety program; the BWO 900 gives a number.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from cam.played import END, FAST, P, axes_of, line, lines_of, texts

from isel_twin import Twin
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Element, Place, Spindle, Tool
from isel_twin.jobs.sending import play
from isel_twin.jobs.toolpaths import Source, source_of

MACHINES = {
    "imc-s8": "4030-hf",
    "c142": "4030-hf",
    "ismif": "4030-hf",
    "gmi99": "4030-servo-hf",
    "bwo900": "4030-servo-hf",
}
TELLING = ["imc-s8", "c142", "gmi99", "bwo900"]
TOP = 24_000.0
SETTINGS = CamSettings(zero=(100.0, 80.0, 30.0), rapid_mm_s=30.0)
FILE = "G21 G90 G94\nF600\n{}\nG4 P5\nG0 X10\nM30\n"


def source(controller: str, words: str, machine: str = "", settings: CamSettings = SETTINGS) -> tuple[Twin, Source]:
    twin = Twin(machine or MACHINES[controller], controller, plant="kinematic")
    text = FILE.format(words).encode()
    made = source_of(text, ".nc", twin.language, controller, lambda: twin.machine, settings)
    assert made is not None
    return twin, made


def speeds(controller: str, words: str, machine: str = "", settings: CamSettings = SETTINGS) -> list[float]:
    """Of the spindle whenever something happens; it has settled at the end of each pause of 5 s."""
    twin, made = source(controller, words, machine, settings)
    found: list[float] = []
    twin.listen(lambda _time, _kind, _what: found.append(twin.spindle_rev_min))
    results = list(play(twin, made.lines, timeout_s=600.0))
    assert [result.command for result in results if not result.ok] == []
    return found


@pytest.mark.parametrize("controller", TELLING)
@pytest.mark.parametrize(
    ("words", "rev_min"),
    [
        ("M3 S12000", 12_000.0),
        ("S12000\nM3", 12_000.0),
        ("M3 S6000\nG4 P5\nS18000", 18_000.0),
        ("S9000 M3\nT1 M6\nM3", 9_000.0),
        ("M3 S24000", TOP),
        ("M3 S30000", TOP),
    ],
)
def test_the_spindle_turns_as_fast_as_the_file_says(controller: str, words: str, rev_min: float) -> None:
    """Within a step of 255 of the output."""
    assert max(speeds(controller, words)) == pytest.approx(rev_min, abs=TOP / 255)


@pytest.mark.parametrize(
    ("controller", "words", "machine", "said"),
    [
        ("ismif", "M3 S12000", "4030-hf", "it follows an output that this controller has not, and stands"),
        ("ismif", "S12000\nM3", "4030-hf", "a spindle speed of 12000 rev/min is not told"),
        ("ismif", "M3 S12000", "4030", "is not told to the spindle, nor is any other: set it by hand"),
        ("imc-s8", "M3 S12000", "4030", "set it by hand, or set [cam] spindle_max_rpm to its speed at 10 V"),
        ("gmi99", "M3 S12000", "4030-servo", "set it by hand, or set [cam] spindle_max_rpm to its speed at 10 V"),
        ("imc-s8", "M3 S30000", "4030-hf", "a spindle speed of 30000 rev/min is more than it makes: 24000 rev/min"),
        ("bwo900", "M3 S30000", "4030-servo-hf", "a spindle speed of 30000 rev/min is more than it makes"),
        ("imc-s8", "M3", "4030-hf", "the spindle is switched on without a speed: it may stand"),
        ("bwo900", "M3", "4030-servo-hf", "the spindle is switched on without a speed: it may stand"),
    ],
)  # fmt: skip
def test_what_is_not_told_to_the_spindle_is_told_to_the_user(
    controller: str, words: str, machine: str, said: str
) -> None:
    _, made = source(controller, words, machine)
    assert [(caution.place.line, said in caution.text) for caution in made.cautions] == [(3, True)]


@pytest.mark.parametrize(("controller", "machine"), [*MACHINES.items(), ("imc-s8", "4030"), ("gmi99", "4030-servo")])
@pytest.mark.parametrize("words", ["", "M5 S0", "M5\nM9"])
def test_files_without_a_spindle_have_no_caution(controller: str, machine: str, words: str) -> None:
    assert source(controller, words, machine)[1].cautions == ()


def test_a_scale_of_the_settings() -> None:
    """The remedy obeyed: 255 * 12000 / 18000 is 170."""
    settings = replace(SETTINGS, spindle_max_rpm=18_000.0)
    _, made = source("imc-s8", "M3 S12000", "4030", settings)
    assert made.cautions == ()
    switched = [each.command for each in made.lines if each.command.startswith("@0B")]
    assert switched == ["@0B4,170", "@0B2,1", "@0B2,0"]


def test_a_spindle_that_is_set_by_hand() -> None:
    """Its own speed needs no word; another one does."""
    axes = replace(axes_of("imc-s8"), spindle_fixed_rpm=11_000.0)
    for rpm, told in ((11_000.0, False), (11_100.0, False), (11_200.0, True)):
        lines = lines_of("imc-s8", [Spindle(P, 1, rpm), END], axes=axes)
        assert any("by hand it stands at 11000 rev/min" in each.text for each in lines) is told


SWITCHED = [
    Spindle(Place(2), 0, 6000.0), Spindle(Place(3), 1), line(10, 0, 0), Spindle(Place(4), 1, 12000.0), line(20, 0, 0),
    Spindle(Place(5), 1, 12000.0), Tool(Place(6), 2), Spindle(Place(7), 1), line(30, 0, 0), END,
]  # fmt: skip


@pytest.mark.parametrize(
    ("controller", "begins", "made"),
    [
        ("imc-s8", ("@0B",), ["@0B4,64", "@0B2,1", "@0B4,128", "@0B2,0", "@0B2,1", "@0B2,0"]),
        ("gmi99", ("m", "p"), ["m100;1;6000", "p10;16;0", "m100;1;12000", "p10;17;0", "p10;16;0", "p10;17;0"]),
        ("ismif", ("A",), ["A1<1>", "A0<1>", "A1<1>", "A0<1>"]),
    ],
)
def test_lines_of_a_spindle(controller: str, begins: tuple[str, ...], made: list[str]) -> None:
    """S alone switches nothing; a new one while it turns is the speed only; the last one holds over M6."""
    axes = replace(axes_of(controller), spindle_max_rpm=TOP)
    assert [text for text in texts(lines_of(controller, SWITCHED, axes=axes)) if text.startswith(begins)] == made


def test_blocks_of_a_spindle() -> None:
    blocks = [text.split(" ", 1)[-1] for text in texts(lines_of("bwo900", SWITCHED))]
    switched = [block for block in blocks if block.startswith(("M3", "M5"))]
    assert switched == ["M3 S6000", "M3 S12000", "M5", "M3 S12000", "M5", "M30"]


def test_a_raster_of_speeds_is_a_line_each() -> None:
    """As lasers write it: S in every line, and no line where it stays."""
    axes = replace(axes_of("imc-s8"), spindle_max_rpm=255.0)
    path: list[Element] = [Spindle(P, 1, 0.0)]
    for k, rpm in enumerate((10.0, 20.0, 20.0, 0.0), 1):
        path += [Spindle(P, 1, rpm), line(float(k), 0, 0)]
    lines = texts(lines_of("imc-s8", [*path, END], FAST, axes))
    assert [text for text in lines if text.startswith("@0B")] == [
        "@0B4,0", "@0B2,1", "@0B4,10", "@0B4,20", "@0B4,0", "@0B2,0",
    ]  # fmt: skip


def test_speeds_that_are_not_told_part_no_motions() -> None:
    """Cuts in one line are one telegram of the GMI99, and one job of the iSMIF, but for the remark at the first S."""
    path: list[Element] = [Spindle(P, 1, 100.0)]
    for k in range(1, 5):
        path += [Spindle(P, 1, 100.0 + k), line(float(k), 0, 0)]
    assert [text.count("81h") for text in texts(lines_of("gmi99", [*path, END])) if "81h" in text] == [4]
    assert [text for text in texts(lines_of("ismif", [*path, END])) if text[:1] == "L"][-1] == "L0,X320<1>"
    assert sum(text.endswith("<1>") for text in texts(lines_of("ismif", [*path, END])) if text[:1] == "L") == 1
