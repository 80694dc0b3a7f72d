"""Files that CAM programs have really written, of drawings made for this: run on every controller, or refused by name.

part      a plate of 40 x 30 mm with corners of r = 5, profiled outside by a cutter of 5 mm; FreeCAD 0.20.2,
          Path workbench, its post processors as they are
outline   a rectangle X 10 .. 45, Y 15 .. 40 with one round corner of r = 5; Inkscape 1.2.2 (hpgl_output, with the
          options it comes with; gcodetools), vpype 1.15.0 with vpype-gcode 0.13.0, svg-to-gcode 1.5.4
page      a rectangle of 30 x 20 mm and a circle of r = 6 mm in PostScript; pstoedit 3.78
graph     four points; GNU plotutils 2.6, graph -T hpgl
holes     three holes of an Excellon file; gerbv 2.9.6, -x idrill
"""

from __future__ import annotations

from pathlib import Path

import pytest
from cam.played import axes_of

from isel_twin.cam.reader import head_of, text_lines
from isel_twin.cam.registry import reader_for
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Element, Line
from isel_twin.controller import offers
from isel_twin.jobs.job import parse_job
from isel_twin.language import WritesToolpaths, create_language

MADE = Path(__file__).parent / "made"
SETTINGS = CamSettings(zero=(100.0, 100.0, 50.0), feed_mm_s=10.0)
CONTROLLERS = ["imc-s8", "ismif", "gmi99", "bwo900"]
PART, OUTLINE = (-2.5, 42.5, -2.5, 32.5), (10.0, 45.0, 15.0, 40.0)
PAGE = (10.0, 40.0, 10.0, 30.0)  # 28.35 .. 113.4, 28.35 .. 85 points of 1/72 inch
EXTENTS = {
    "freecad_dynapath.nc": PART,
    "freecad_grbl.nc": PART,
    "freecad_linuxcnc.nc": PART,
    "freecad_mach3_mach4.nc": PART,
    "freecad_marlin.nc": PART,
    "freecad_smoothie.nc": PART,
    "freecad_uccnc.nc": PART,
    "gcodetools.ngc": OUTLINE,
    "svg_to_gcode.gcode": OUTLINE,
    "vpype.nc": OUTLINE,
    "pstoedit.hpgl": PAGE,
    "pstoedit_hpgl2.hpgl": PAGE,
    # 20 % and 80 % of the plotter's 8128 units of 0.025 mm; the least Y is that of the third point, 1 of 5
    "plotutils.hpgl": (0.2 * 203.2, 0.8 * 203.2, 0.2 * 203.2, 0.8 * 203.2),
}
OTHERS = ["inkscape.hpgl", "vpype.hpgl", "gerbv.ncp"]
REFUSED = {
    "freecad_centroid.nc": "line 50, column 1: M25 is unknown",
    "freecad_nccad.nc": "line 6, column 1: G77 is unknown",
    "pstoedit.gcode": "line 7, column 1: parameters # and expressions",
}


def path_of(file: Path) -> list[Element]:
    reader = reader_for(head_of(file.read_bytes()), file.suffix)
    assert reader is not None
    with file.open("rb") as source:
        return list(reader.read(text_lines(source), SETTINGS))


def extents(path: list[Element]) -> tuple[float, ...]:
    """Least and greatest X and Y of the ends of cuts, mm from the zero of the workpiece."""
    ends = [element.to for element in path if isinstance(element, Line | Arc)]
    xs, ys = [x - 100.0 for x, _, _ in ends], [y - 100.0 for _, y, _ in ends]
    return min(xs), max(xs), min(ys), max(ys)


@pytest.mark.parametrize("name", EXTENTS)
def test_it_cuts_what_was_drawn(name: str) -> None:
    assert extents(path_of(MADE / name)) == pytest.approx(EXTENTS[name], abs=0.06)  # of chords and rounded units


def test_inkscape_s_knife_makes_a_stroke_of_its_own() -> None:
    """Its options for a knife lengthen and round: by 0.25 mm, after a stroke from (0, 0) to (0, 2.25)."""
    least_x, most_x, least_y, most_y = extents(path_of(MADE / "inkscape.hpgl"))
    assert (least_x, least_y) == (0.0, 0.0)
    assert most_x == pytest.approx(35.25, abs=0.3)
    assert most_y == pytest.approx(25.25, abs=0.3)


def test_a_plotter_with_units_of_its_own() -> None:
    """vpype writes for the HP 7475A, on whose page the outline lies crosswise; its unit is 1/1021 inch."""
    least_x, most_x, least_y, most_y = extents(path_of(MADE / "vpype.hpgl"))
    larger = 0.025 / (25.4 / 1021)
    assert (most_x - least_x, most_y - least_y) == pytest.approx((25.0 * larger, 35.0 * larger), abs=0.06)


def test_holes_of_a_drill_file() -> None:
    ends = [element.to for element in path_of(MADE / "gerbv.ncp") if isinstance(element, Line)]
    holes = [(round(x - 100.0, 3), round(y - 100.0, 3)) for x, y, _ in ends]
    assert holes == [(10.0, 5.0), (12.54, 5.0), (-2.0, 3.5)]


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("name", [*EXTENTS, *OTHERS])
def test_every_controller_has_commands_for_it(name: str, controller: str) -> None:
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    made = [line.text for line in language.written(iter(path_of(MADE / name)), axes_of(controller), SETTINGS)]
    assert len(parse_job("\n".join(made), language, controller)) > 1


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_says_its_line_and_why(name: str) -> None:
    with pytest.raises(CamError, match=f"^{REFUSED[name]}"):
        path_of(MADE / name)


def test_every_file_is_looked_at() -> None:
    assert {file.name for file in MADE.iterdir()} == {*EXTENTS, *OTHERS, *REFUSED}
