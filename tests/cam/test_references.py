"""Reference runs in a job file, zeros that are switched off, and codes that cancel what was never begun."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cam.played import END, FAST, P, line, lines_of, played, rapid, texts

from isel_twin.cam.estimate import Estimate
from isel_twin.cam.toolpath import CamError, Element, Reference
from isel_twin.jobs.checks.contour import drawing
from tests.cam.short import UP, cautions, told

DIN = dataclasses.replace(UP, dialect="din")
STRICT = dataclasses.replace(UP, strict=True)
ZERO = dataclasses.replace(DIN, zero=(10.0, 20.0, 30.0))


@pytest.mark.parametrize(
    "first",
    [
        "G00 G49 G40.1 G17 G80 G50 G90",
        "G21 G15 G69 G40",
        "G90 G94 G17 G69",
        "G0 G40.1 G50 X0",
        "G49 G80 G15 G69 G50 X0 G0",
    ],
)
def test_what_cancels_nothing_has_no_effect(first: str) -> None:
    """As Mach3's posts begin; LinuxCNC knows none of them."""
    assert told("gcode", f"{first}\nG21 G0 X5\nM30\n")[-2:] == ["rapid 5 0 0", "end"]
    assert cautions("gcode", f"G21\n{first}\nG0 X5\nM30\n") == []
    with pytest.raises(CamError, match=r"G(15|40.1|50|69) is unknown to LinuxCNC; leave it out"):
        told("gcode", f"{first}\nM30\n", STRICT)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("G50 S2000", "lathes"),
        ("G50 X1 Z2", "lathes"),
        ("G51 X2", "scaling"),
        ("G16", "polar"),
        ("G68 R30", "rotation"),
        ("G12 I5", "round pockets"),
    ],
)
def test_what_begins_it_is_refused_by_name(line: str, why: str) -> None:
    with pytest.raises(CamError, match=f"^line 2, column 1: .*{why}"):
        told("gcode", f"G21\n{line}\nM2\n")


@pytest.mark.parametrize(
    ("line", "axes"), [("G74", "XYZ"), ("G74 X0 Y0", "XY"), ("G74 Z0", "Z"), ("G90 G74 X1 Y2 Z3", "XYZ")]
)
def test_g74_of_din_is_a_reference_run(line: str, axes: str) -> None:
    """Where it stands; behind it the axes are at 0 of the machine, which the zero of the workpiece is not."""
    after = {"XYZ": "rapid 15 0 0", "XY": "rapid 15 0 31", "Z": "rapid 15 22 0"}[axes]
    text = f"G71\nG0 X1 Y2 Z1\n{line}\nG0 X5\nM30\n"
    assert [each for each in told("gcode", text, ZERO) if each != "caution"] == [
        *("rapid 11 22 31", f"reference {axes}", after, "end"),
    ]
    told_so = [text for text in cautions("gcode", text, ZERO) if "G74" in text]
    assert bool(told_so) == ("X1" in line), "an order of axes is not kept"
    assert f"reference {axes}" in told("gcode", text), "G71 tells of DIN, too"
    for other in (UP, dataclasses.replace(UP, dialect="rs274"), STRICT):
        with pytest.raises(CamError, match="G74 is tapping"):
            told("gcode", f"G21\n{line}\nM30\n", other)


@pytest.mark.parametrize(
    ("line", "axes"), [("REF XYZ", "XYZ"), ("REF X Z", "XZ"), ("N5 ref zyx", "XYZ"), ("REF", "XYZ")]
)
def test_ref_of_ncp_is_a_reference_run(line: str, axes: str) -> None:
    after = "rapid 15 0 0" if axes == "XYZ" else "rapid 15 22 0"
    text = f"IMF_PBL\nFASTABS X1000 Y2000 Z1000\n{line}\nFASTABS X5000\nPROGEND\n"
    assert [each for each in told("ncp", text, ZERO) if each != "caution"] == [
        *("rapid 11 22 31", f"reference {axes}", after, "end"),
    ]


def test_g53_alone_switches_zeros_off() -> None:
    """In DIN until a zero is selected again; outside it is said. With G0 it is LinuxCNC's, of one line."""
    text = "G90\nG0 X1\n{}\nG0 X1 Y1\nG0 X2\nG54 G0 X1\nM30\n"
    off = ["rapid 11 0 0", "rapid 1 1 0", "rapid 2 1 0", "rapid 11 1 0", "end"]
    anywhere = dataclasses.replace(ZERO, dialect="")
    for head in ("G71", "G21"):
        for settings in (ZERO, anywhere):
            made = told("gcode", f"{head}\n{text.format('G17 G53')}", settings)
            assert [each for each in made if each != "caution"] == off
    assert "G53 alone is read as DIN" in cautions("gcode", f"G21\n{text.format('G53')}", anywhere)[0]
    once = told("gcode", f"G21\n{text.format('G53 G0 Y0')}", anywhere)
    assert once == ["rapid 11 0 0", "rapid 11 0 0", "rapid 11 21 0", "rapid 12 21 0", "rapid 11 21 0", "end"]
    for refused in (dataclasses.replace(UP, dialect="rs274"), STRICT):
        with pytest.raises(CamError, match="G53 wants X, Y or Z, with G0 or G1"):
            told("gcode", f"G21\n{text.format('G53')}", refused)


PATH: list[Element] = [rapid(20, 10, -5), line(22, 10, -5), Reference(P, (0, 2)), rapid(5, 6, -1), END]
WRITTEN = {
    "imc-s8": ["@0R5", "@0z1"],
    "ismif": ["$HZX<1>"],
    "gmi99": ["Q4;1", "Q1;1"],
}


@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_each_controller_makes_it_where_it_stands(controller: str) -> None:
    """The end is counted from the switches again, Y has stayed where it was until the next move."""
    settings = dataclasses.replace(FAST, z_sign=-1)
    run = played(controller, PATH, settings)
    assert np.allclose(run.end_mm, (5.0, 6.0, 1.0), atol=1.0 / run.steps_mm)
    lines = texts(lines_of(controller, PATH, settings))
    if controller == "bwo900":
        assert [text for text in lines if "caution: a reference run is made before a program only" in text]
        return
    wanted = WRITTEN[controller]
    at = lines.index(wanted[0], 5)
    assert lines[at : at + len(wanted)] == wanted


def test_the_way_behind_it_begins_where_it_ends() -> None:
    """For what the file says that it takes, and for its drawing: 5 mm at 10 mm/s from X 0, Y 10; Z goes first."""
    path: list[Element] = [rapid(0, 10, 0), Reference(P, (0, 1, 2)), line(5, 0, 0), END]
    sums = Estimate(dataclasses.replace(UP, rapid_mm_s=10.0))
    assert len(list(sums.watched(iter(path)))) == 4
    assert sums.seconds == pytest.approx(1.0 + 0.5)
    drawn = drawing(iter(path), UP, 0.05)
    assert drawn.points_mm.tolist() == [[0, 0, 0], [0, 10, 0], [0, 10, 0], [0, 0, 0], [5, 0, 0]]
    assert drawn.cuts.tolist() == [False, False, False, True]
