"""Radius correction of random contours, judged by a disc that rolls along them (rolling.py): manual, 7.2 to 7.7.

    everywhere     the centre is the radius away from the contour, on its side, and never nearer to an element beside it
    possible       no message if the disc can touch every element without cutting into its neighbours; one if it cannot
    the same       in all planes, mirrored, rotated, and backwards with the other side

Contours are programmed with 7 digits, so that the tool's centre lies within 1e-5 mm of where it belongs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from conformance.rows import shows
from firmware.bwo900.rolling import AXES, Piece, Points, contour, rolls, steps, words
from firmware.bwo900.run import Analysed
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Straight
from isel_twin.firmware.bwo900.geometry.offset import Offset
from isel_twin.firmware.bwo900.messages import ProgramError
from tests.thorough import drawn

NEAR = 1e-5
SIDES = {"G41": 1.0, "G42": -1.0}
OTHER = {"G41": "G42", "G42": "G41"}
INDEX = {"X": 0, "Y": 1, "Z": 2}
CANNOT = (1152, 1156, 1223)
EXAMPLES = 30
UNFIT = [HealthCheck.filter_too_much]
"""Contours of which nobody can tell are left out."""

sides = st.sampled_from(["G41", "G42"])
radii = st.sampled_from([1.0, 3.1, 7.3])


def filtered(text: str, *filters: Contour | Offset, position: tuple[float, ...] = (0.0,) * 3) -> list[PathBlock]:
    """The blocks of a program that have a path, through filters. Raises ProgramError."""
    done = Analysed(text, position=position).blocks
    for item in filters:
        done = [out for block in done for out in item.push(block)] + item.flush()
    return [block for block in done if block.elements]


def tried(
    text: str, position: tuple[float, ...] = (0.0,) * 3, threshold: float | None = None
) -> tuple[list[PathBlock], int]:
    """The corrected blocks of a program, or the number of its message."""
    try:
        return filtered(text, Contour(), Offset(threshold), position=position), 0
    except ProgramError as error:
        return [], error.number


def program(pieces: Sequence[Piece], side: str, radius: float, plane: str = "G17") -> list[str]:
    """N10 switches the correction on, N1000, N2000 ... are the pieces, N90000 switches it off, far away."""
    u, v, _ = AXES[plane]
    along = [f"N{1000 * number} {word}" for number, word in enumerate(words(pieces, plane), 1)]
    (x, y), off = pieces[0].start, f"N90000 G40 G1 {u}500 {v}500"
    return [f"N5 {plane} F100 tr:{radius}", f"N10 {side} G1 {u}{x:.7f} {v}{y:.7f}", *along, off, "N99999 M30"]


def before(pieces: Sequence[Piece], plane: str = "G17") -> tuple[float, ...]:
    """A place 50 mm before the contour, straight on."""
    place, ahead = [0.0, 0.0, 0.0], pieces[0].heading(0.0)
    u, v, _ = AXES[plane]
    place[INDEX[u]] = pieces[0].start[0] - 50.0 * math.cos(ahead)
    place[INDEX[v]] = pieces[0].start[1] - 50.0 * math.sin(ahead)
    return tuple(place)


def number_of(block: PathBlock) -> int | None:
    """Of the piece that a block belongs to."""
    return block.number // 1000 - 1 if block.number % 1000 == 0 and block.number < 90_000 else None


def flat(element: Element, plane: str = "G17", count: int = 17) -> Points:
    """Points of an element in its plane."""
    u, v, _ = AXES[plane]
    return np.array([[p[INDEX[u]], p[INDEX[v]]] for p in map(element.point, np.linspace(0.0, 1.0, count))])


def distance(places: Points, pieces: Sequence[Piece]) -> Points:
    """Of places to the nearest of some pieces."""
    return np.min([piece.distance(places) for piece in pieces], axis=0)


def keeps_off(
    pieces: Sequence[Piece], blocks: Sequence[PathBlock], radius: float, side: float, plane: str = "G17"
) -> None:
    """The path beside the pieces is the radius away from them, on its side."""
    for block in blocks:
        if (number := number_of(block)) is None:
            continue
        moved, *corner = block.elements
        around = pieces[max(number - 1, 0) : number + 2]
        assert distance(flat(moved, plane), around) == pytest.approx(radius, abs=NEAR), block
        beside = pieces[number].beside(np.linspace(0.0, 1.0, 201), side * radius)
        off = np.hypot(*(beside - flat(moved, plane)[8]).T).min()
        assert off < 0.01 * (pieces[number].length + abs(pieces[number].sweep) * radius)
        for element in corner:
            assert isinstance(element, Arc)
            assert element.centre == pytest.approx(pieces[number].end, abs=NEAR)
            assert distance(flat(element, plane), pieces[number : number + 2]) == pytest.approx(radius, abs=NEAR)


def joined(blocks: Sequence[PathBlock]) -> None:
    """Every element begins where the one before it has ended, in all axes; blocks keep their order."""
    path = [element for block in blocks for element in block.elements]
    for a, b in pairwise(path):
        assert a.end == pytest.approx(b.start, abs=1e-9), (a, b)
    assert [block.number for block in blocks] == sorted(block.number for block in blocks)


Job = tuple[list[Piece], str, float]


@st.composite
def jobs(draw: st.DrawFn) -> Job:
    """Pieces, side, radius."""
    return contour(draw(steps())), draw(sides), draw(radii)


@st.composite
def possible(draw: st.DrawFn) -> Job:
    """The same; a tool can roll along."""
    pieces, side, radius = draw(jobs())
    assume((rolls(pieces, SIDES[side] * radius) or 0.0) > 0.01)
    return pieces, side, radius


@shows("bwo900-7.3-5")
@given(jobs(), st.sampled_from(["G17", "G18", "G19"]), st.data())
@settings(max_examples=drawn(3 * EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_a_tool_rolls_along_every_contour_it_can(job: Job, plane: str, data: st.DataObject) -> None:
    """With blocks without a path, moves across the plane and helices in between; a message where it cannot."""
    pieces, side, radius = job
    room = rolls(pieces, SIDES[side] * radius)
    assume(room is not None and abs(room) > 0.01)
    third, lines, height, heights = AXES[plane][2], program(pieces, side, radius, plane), 0.0, dict[int, float]()
    made = lines[:2]
    for number, line in enumerate(lines[2:-2]):
        kinds = st.sampled_from(["", "", "", "P1:1", "G1", "P1:1|G1|M8", "G1|G1", "P1:1|" * 12])
        for extra, word in enumerate(filter(None, data.draw(kinds).split("|"))):
            height -= word == "G1"
            made.append(f"N{1000 * number + 100 + extra} {word}" + (f" {third}{height}" if word == "G1" else ""))
        height -= data.draw(st.sampled_from([0.0, 0.0, 2.0]))
        heights[1000 * (number + 1)] = height
        made.append(f"{line} {third}{height}")
    blocks, message = tried("\n".join([*made, *lines[-2:]]), before(pieces, plane))
    if room < 0.0:
        assert message in CANNOT
        return
    assert not message
    joined(blocks)
    keeps_off(pieces, blocks, radius, SIDES[side], plane)
    ends = {block.number: block.finish[INDEX[third]] for block in blocks if number_of(block) is not None}
    assert ends == pytest.approx(heights)


@shows("bwo900-7.3-6")
@given(possible())
@settings(max_examples=drawn(EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_backwards_with_the_other_side_it_is_the_same_path(job: Job) -> None:
    pieces, side, radius = job
    back = [
        Piece(p.end, p.start, p.centre, p.radius, p.begin + (p.sweep or math.pi), -p.sweep) for p in reversed(pieces)
    ]
    paths = []
    for way, chosen in ((pieces, side), (back, OTHER[side])):
        blocks, _ = tried("\n".join(program(way, chosen, radius)), before(way))
        paths.append([element for b in blocks if number_of(b) is not None for element in b.elements])
    for a, b in zip(paths[0], reversed(paths[1]), strict=True):
        assert flat(a) == pytest.approx(flat(b)[::-1], abs=NEAR)


@shows("bwo900-7.3-7")
@given(
    jobs(),
    st.sampled_from(["G17", "G18", "G19"]),
    st.sampled_from(["G61", "G62", "G61 G62", "G45 P160:7 P161:-3 P163:33.5", "G92 X3 Y4 Z5"]),
)
@settings(max_examples=drawn(EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_frames_move_the_corrected_path_as_a_whole(job: Job, plane: str, head: str) -> None:
    """A mirrored, turned or shifted program gives the mirrored, turned or shifted path, or the same message."""
    u, v, _ = AXES[plane]
    found, messages = [], []
    for frame in ("G60", head):
        text = "\n".join([f"N1 {plane} {frame}", f"N2 G0 F100 {u}-20 {v}-30", *program(*job, plane)])
        blocks, message = tried(text)
        messages.append(message)
        found.append([flat(element, plane) for b in blocks if b.number > 2 for element in b.elements])
    assert messages[0] == messages[1]
    angle = math.radians(33.5 if "G45" in head else 0.0)
    turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    shift = {"G45": (7.0, -3.0), "G92": tuple({"X": 3.0, "Y": 4.0, "Z": 5.0}[axis] for axis in (u, v))}
    signs = -1.0 if "G61" in head else 1.0, -1.0 if "G62" in head else 1.0
    for a, b in zip(*found, strict=True):
        assert (a @ turned) * signs + shift.get(head[:3], (0.0, 0.0)) == pytest.approx(b, abs=NEAR)


# Changes on the way


def away(element: Element, piece: Piece) -> tuple[float, float]:
    """Distance of its ends to a piece that may be prolonged: to the whole line or circle."""
    ends = flat(element, count=2)
    if piece.sweep:
        first, last = np.abs(np.hypot(*(ends - piece.centre).T) - piece.radius)
    else:
        first, last = np.abs((ends - piece.start) @ np.array([-math.sin(piece.begin), math.cos(piece.begin)]))
    return float(first), float(last)


@shows("bwo900-7.4-2")
@given(jobs(), st.data())
@settings(max_examples=drawn(EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_another_radius_counts_from_the_end_of_the_next_element(job: Job, data: st.DataObject) -> None:
    """The corner with the old radius, the end of the element behind it with the new one; lines and circles (7.4)."""
    pieces, side, first = job
    at, second = data.draw(st.integers(0, len(pieces) - 1)), data.draw(st.sampled_from([0.0, 0.5, 2.0, 5.0]))
    assume(at and all((rolls(pieces, SIDES[side] * radius) or 0.0) > 0.01 for radius in (first, second) if radius))
    word = data.draw(st.sampled_from([f"tr:{second}", f"t:{second - first}"]))
    lines = program(pieces, side, first)
    text = "\n".join([*lines[: 2 + at], f"N{1000 * at + 500} {word}", *lines[2 + at :]])
    blocks, message = tried(text, before(pieces))
    assert message in (0, 1223)  # an element at two distances may take more of the one behind it
    joined(blocks)
    for block in blocks:
        if (number := number_of(block)) is not None:
            expected = first if number <= at else second, first if number < at else second
            assert away(block.elements[0], pieces[number]) == pytest.approx(expected, abs=NEAR)


@shows("bwo900-7.3-4")
@given(jobs(), st.data())
@settings(max_examples=drawn(EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_a_change_of_sides_goes_around_the_corner(job: Job, data: st.DataObject) -> None:
    pieces, side, radius = job
    at = data.draw(st.integers(0, len(pieces) - 1))
    parts = (pieces[:at], SIDES[side]), (pieces[at:], -SIDES[side])
    assume(at and all((rolls(part, s * radius) or 0.0) > 0.01 for part, s in parts))
    lines = program(pieces, side, radius)
    lines[2 + at] = lines[2 + at].replace(" ", f" {OTHER[side]} ", 1)
    blocks, message = tried("\n".join(lines), before(pieces))
    assert not message
    joined(blocks)
    mine = [block for block in blocks if number_of(block) is not None]
    corner = mine[at - 1].elements[1:]
    assert all(isinstance(e, Arc) and e.centre == pytest.approx(pieces[at].start, abs=NEAR) for e in corner)
    for number, block in enumerate(mine):
        assert away(block.elements[0], pieces[number]) == pytest.approx((radius, radius), abs=NEAR)


@shows("bwo900-8.5-8")
@given(possible(), st.sampled_from([0.0, 30.0, 100.0, 179.0]))
@settings(max_examples=drawn(EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_outer_corners_are_prolonged_up_to_an_angle(job: Job, threshold: float) -> None:
    """P8845: arcs above it (0: 120 degrees), below it both are prolonged to where they meet."""
    pieces, side, radius = job
    blocks, message = tried("\n".join(program(pieces, side, radius)), before(pieces), threshold)
    assert message in (0, 1156, 1223)  # prolonged, they may not meet
    joined(blocks)
    for block in blocks:
        if (number := number_of(block)) is None:
            continue
        assert away(block.elements[0], pieces[number]) == pytest.approx((radius, radius), abs=NEAR)
        arc = block.elements[1:]
        if number + 1 < len(pieces):
            turned = math.remainder(pieces[number + 1].heading(0.0) - pieces[number].heading(1.0), 2.0 * math.pi)
            back = abs(turned) > math.pi - 1e-6
            outer = back or turned * SIDES[side] < -1e-6
            assert bool(arc) == (outer and math.degrees(abs(turned)) > (threshold or 120.0))


def pieces_of(blocks: Sequence[PathBlock]) -> list[Piece]:
    """The elements of a program as pieces."""
    made = []
    for element in (element for block in blocks for element in block.elements):
        start, end = element.start[:2], element.end[:2]
        if isinstance(element, Straight):
            made.append(Piece(start, end, begin=math.atan2(end[1] - start[1], end[0] - start[0])))
        else:
            begin = math.atan2(start[1] - element.centre[1], start[0] - element.centre[0])
            made.append(Piece(start, end, element.centre, math.dist(start, element.centre), begin, element.sweep_rad))
    return made


@shows("bwo900-7.3-8")
@given(jobs(), st.data())
@settings(max_examples=drawn(2 * EXAMPLES), deadline=None, suppress_health_check=UNFIT)
def test_corners_that_are_put_in_are_corrected_too(job: Job, data: st.DataObject) -> None:
    """G12 and G123 first, then the radius: along the contour that they make, with moves across the plane in between."""
    pieces, side, radius = job
    lines, kinds = program(pieces, side, radius), ["", "", "G12 P71:1.5 P70:-- ", "G12 P70:1 P71:-- ", "G123 "]
    for number in range(2, len(lines) - 3):
        lines[number] = lines[number].replace(" ", f" {data.draw(st.sampled_from(kinds))}", 1)
        if data.draw(st.booleans()):
            lines[number] += f"\n{lines[number].split(' ')[0][:-2]}50 P1:1"
    text = "\n".join(lines)
    try:
        plain = [b for b in filtered(text, Contour(), position=before(pieces)) if 1000 <= b.number < 90_000]
    except ProgramError:  # the corner is not possible
        return
    whole = pieces_of(plain)
    assume(min(piece.length for piece in whole) > 1e-3)
    room = rolls(whole, SIDES[side] * radius)
    assume(room is not None and abs(room) > 0.01)
    blocks, message = tried(text, before(pieces))
    assert bool(message) == (room < 0.0), message
    if message:
        return
    joined(blocks)
    made = [element for block in blocks if 1000 <= block.number < 90_000 for element in block.elements]
    for element in made:
        assert distance(flat(element), whole).max() < radius + NEAR
    at = 0
    for number, piece in enumerate(whole):  # each has its element, in order
        around = whole[max(number - 1, 0) : number + 2]
        beside = [
            n
            for n in range(at, len(made))
            if away(made[n], piece) == pytest.approx((radius, radius), abs=NEAR)
            and distance(flat(made[n]), around).min() > radius - NEAR
        ]
        assert beside
        at = beside[0] + 1


@shows("bwo900-7.3-9")
@pytest.mark.parametrize(("g", "turn", "moved"), [("G41", 1.0, 17.0), ("G42", 1.0, 23.0), ("G42", -1.0, 17.0)])
def test_full_circles(g: str, turn: float, moved: float) -> None:
    """A bore of 20 mm, by its centre line: in along X, once around, out again. Inside both corners cut 3 mm off."""
    circle = f"{'G3' if turn > 0 else 'G2'} X20 Y0 I0 J0"
    lines = ["N5 F100 tr:3", f"N10 {g} G1 X5 Y0", "N20 X20", f"N30 {circle}", "N40 G1 X5", "N50 G40 X0", "N60 M30"]
    blocks, message = tried("\n".join(lines))
    assert not message
    joined(blocks)
    arc = next(b.elements[0] for b in blocks if b.number == 30)
    assert isinstance(arc, Arc)
    assert arc.radius_mm == pytest.approx(moved)
    inside = moved < 20.0
    cut = 2.0 * math.asin(3.0 / 17.0) if inside else 0.0
    assert abs(arc.sweep_rad) == pytest.approx(2.0 * math.pi - cut)
    if inside:
        assert arc.start[:2] == pytest.approx((math.sqrt(17.0**2 - 3.0**2), turn * 3.0))


@shows("bwo900-7.3-9")
def test_full_circles_that_begin_tangentially() -> None:
    """In and out in quarters of a circle: the whole circle is made."""
    around = ["N20 G3 X20 Y0 I10 J0", "N30 X20 Y0 I0 J0", "N40 X10 Y10 I10 J0"]
    blocks, message = tried("\n".join(["N10 F100 tr:3 G41 G1 X10 Y-10", *around, "N50 G40 G1 X0 Y0", "N60 M30"]))
    assert not message
    joined(blocks)
    arcs = [element for block in blocks for element in block.elements if isinstance(element, Arc)]
    assert [math.degrees(arc.sweep_rad) for arc in arcs] == pytest.approx([90.0, 360.0, 90.0])
    assert [arc.radius_mm for arc in arcs] == pytest.approx([7.0, 17.0, 7.0])


def reversal(length: float, radius: float, sweep_deg: float, aside_deg: float = 0.0) -> list[Piece]:
    """A line along X, and an arc that leaves its end backwards."""
    return contour([(0.0, length, 0.0), (180.0 + aside_deg, radius, sweep_deg)])


@shows("bwo900-7.3-5")
@pytest.mark.parametrize("aside_deg", [0.0, 0.02, -0.02])
@pytest.mark.parametrize(("side", "sweep_deg"), [("G41", -60.0), ("G42", 60.0)])
def test_an_arc_straight_back_on_the_side_of_the_tool_is_an_inner_corner(
    side: str, sweep_deg: float, aside_deg: float
) -> None:
    """Line and circle R touch; moved by r they meet 2 sqrt(R r) before the corner, or never on a shorter line."""
    radius, arc_radius = 3.0, 20.0
    meeting = 2.0 * math.sqrt(arc_radius * radius)
    pieces = reversal(50.0, arc_radius, sweep_deg, aside_deg)
    blocks, message = tried("\n".join(program(pieces, side, radius)), before(pieces))
    assert not message
    joined(blocks)
    line, arc = (block.elements for block in blocks if number_of(block) is not None)
    assert [len(line), len(arc)] == [1, 1]
    assert line[0].end[:2] == pytest.approx((50.0 - meeting, SIDES[side] * radius), abs=0.02)
    for points in (flat(line[0]), flat(arc[0])):
        assert distance(points, pieces).min() > radius - NEAR
    short = reversal(meeting - 1.0, arc_radius, sweep_deg, aside_deg)
    assert tried("\n".join(program(short, side, radius)), before(short))[1] == 1223


@shows("bwo900-7.3-5")
@pytest.mark.parametrize(("side", "sweep_deg"), [("G41", 60.0), ("G42", -60.0)])
def test_an_arc_straight_back_on_the_other_side_is_an_outer_corner(side: str, sweep_deg: float) -> None:
    radius, pieces = 3.0, reversal(50.0, 20.0, sweep_deg)
    blocks, message = tried("\n".join(program(pieces, side, radius)), before(pieces))
    assert not message
    keeps_off(pieces, blocks, radius, SIDES[side])
    corner = [element for block in blocks if number_of(block) == 0 for element in block.elements[1:]]
    assert [abs(arc.sweep_rad) for arc in corner if isinstance(arc, Arc)] == [pytest.approx(math.pi, abs=1e-6)]


@shows("bwo900-7.3-5")
@pytest.mark.parametrize("side", ["G41", "G42"])
@pytest.mark.parametrize("sweep_deg", [0.0, 60.0, -60.0])
def test_the_way_back_on_itself_is_an_outer_corner(side: str, sweep_deg: float) -> None:
    """A line and the same line, an arc and the same arc."""
    radius, pieces = 3.0, contour([(0.0, 20.0, sweep_deg), (180.0, 20.0, -sweep_deg)])
    blocks, message = tried("\n".join(program(pieces, side, radius)), before(pieces))
    assert not message
    keeps_off(pieces, blocks, radius, SIDES[side])


@shows("bwo900-4.4-1")
@pytest.mark.parametrize("sweep_deg", [60.0, -60.0])
def test_a_rounding_between_a_line_and_an_arc_straight_back(sweep_deg: float) -> None:
    """It lies between them: its centre is P71 beside the line, 2 sqrt(R P71) before the corner."""
    rounding, arc_radius = 1.5, 20.0
    pieces = reversal(50.0, arc_radius, sweep_deg)
    line, arc = words(pieces)
    text = f"N10 G1 F100 X0 Y0\nN20 G12 P71:{rounding} {line}\nN30 {arc}\nN40 M30"
    made = [element for block in filtered(text, Contour(), position=(-50.0, 0.0, 0.0)) for element in block.elements]
    put = made[2]
    assert isinstance(put, Arc)
    aside = math.copysign(rounding, -sweep_deg)
    assert put.centre == pytest.approx((50.0 - 2.0 * math.sqrt(arc_radius * rounding), aside), abs=1e-5)
