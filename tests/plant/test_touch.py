"""The touch probe and the plate for tool lengths: distances, law, instants, on both plants (plant/24)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.machine import Fixture, Machine, MachineError, load_machine, with_fixtures, with_overrides
from isel_twin.native import core
from isel_twin.plant import Plant, Threshold
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant
from isel_twin.plant.touch import FEELER, feelers, targets

TABLE_MM = 147.0
"""Z of the tool's point on the table of the 4030."""
BOX = Fixture("box", "box", (40.0, 20.0, 30.0), (200.0, 100.0, 0.0), 30.0)
POST = Fixture("post", "cylinder", (30.0, 40.0), (100.0, 200.0, 5.0))
RING = Fixture("ring", "ring", (60.0, 20.0, 15.0), (200.0, 200.0, 0.0))
PLATE = Fixture("plate", "cylinder", (30.0, 20.0), (60.0, 60.0, 0.0), plate=True)


def machine(*fixtures: Fixture, probe: bool = True, **overrides: object) -> Machine:
    return with_fixtures(with_overrides(load_machine("4030"), {"probe.enabled": probe, **overrides}), fixtures)


def points(fixture: Fixture, n: int = 80) -> NDArray[np.float64]:
    """Points on the surface of a fixture, [m, 3], machine coordinates, dense."""
    height = fixture.size_mm[-1]
    ups, turns, shares = np.linspace(0, height, n), np.linspace(0, 2 * math.pi, 4 * n), np.linspace(0, 1, n)
    if fixture.shape == "box":
        a, b = fixture.size_mm[0] / 2, fixture.size_mm[1] / 2
        u, v = np.linspace(-a, a, n), np.linspace(-b, b, n)
        walls = [np.stack(np.broadcast_arrays(u[:, None], s * b, ups), -1).reshape(-1, 3) for s in (-1, 1)]
        walls += [np.stack(np.broadcast_arrays(s * a, v[:, None], ups), -1).reshape(-1, 3) for s in (-1, 1)]
        ends = [np.stack(np.broadcast_arrays(u[:, None], v, h), -1).reshape(-1, 3) for h in (0.0, height)]
    else:
        inner = fixture.size_mm[1] / 2 if fixture.shape == "ring" else 0.0
        outer = fixture.size_mm[0] / 2
        cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
        radii = [outer, inner] if inner else [outer]
        walls = [np.stack(np.broadcast_arrays(r * cos, r * sin, ups), -1).reshape(-1, 3) for r in radii]
        rho = inner + shares * (outer - inner)
        ends = [np.stack(np.broadcast_arrays(rho * cos, rho * sin, h), -1).reshape(-1, 3) for h in (0.0, height)]
    local = np.concatenate(walls + ends)
    c, s = math.cos(math.radians(fixture.turn_deg)), math.sin(math.radians(fixture.turn_deg))
    x = fixture.at_mm[0] + c * local[:, 0] - s * local[:, 1]
    y = fixture.at_mm[1] + s * local[:, 0] + c * local[:, 1]
    return np.stack([x, y, TABLE_MM - fixture.at_mm[2] - local[:, 2]], axis=-1)


def feel(feeler: NDArray[np.void], found: NDArray[np.void], *place_m: float) -> None:
    """Let a feeler be with the tool's point at this place."""
    core.first_felt(feeler, found, 1e3 * np.array([place_m]), 0.0, 0)


def distance(target: NDArray[np.void], *place_m: float) -> tuple[float, ...]:
    """Distance from a target [1], and where it grows: deflection and push of a ball of 1 m that pushes with 1 N."""
    ball = np.zeros(1, FEELER)
    ball["radius_m"] = ball["force_n"] = ball["force_z_n"] = 1.0
    ball["over_m"] = math.inf
    feel(ball, target, *place_m)
    return 1.0 - float(ball["deflected_m"][0]), *ball["push_n"][0].tolist()


@pytest.mark.parametrize("fixture", [BOX, POST, RING], ids=lambda one: one.name)
def test_distances_are_those_of_the_nearest_point_of_the_surface(fixture: Fixture) -> None:
    record = targets(machine(fixture), TABLE_MM, 3.0)[:1]
    surface, chance = points(fixture), np.random.default_rng(5)
    middle = np.array([*fixture.at_mm[:2], TABLE_MM - fixture.at_mm[2] - fixture.size_mm[-1] / 2])
    for _ in range(40):
        place = middle + chance.uniform(-1, 1, 3) * (*[fixture.size_mm[0]] * 2, fixture.size_mm[-1])
        d_m, *way = distance(record, *(1e-3 * place))
        away = np.linalg.norm(surface - place, axis=1)
        assert abs(1e3 * d_m) == pytest.approx(away.min(), abs=0.25)
        assert np.linalg.norm(way) == pytest.approx(1.0)
        further = distance(record, *(1e-3 * (place + 1e-4 * np.array(way))))[0]
        assert 1e3 * (further - d_m) == pytest.approx(1e-4, rel=1e-3), "it grows fastest that way"


def test_inside_distances_are_negative() -> None:
    boxed, posted, ringed = targets(machine(BOX, POST, RING), TABLE_MM, 3.0)[:3, None]
    assert distance(boxed, 0.2, 0.1, 0.132)[0] == pytest.approx(-0.01)
    assert distance(posted, 0.1, 0.2, 0.122)[0] == pytest.approx(-0.015)
    assert distance(ringed, 0.2, 0.2, 0.140)[0] == pytest.approx(0.010), "in the bore, 10 mm to its wall"
    assert distance(ringed, 0.215, 0.2, 0.142)[0] == pytest.approx(-0.005)


@pytest.mark.parametrize(
    ("deflection_um", "force_n"), [(-1.0, 0.0), (4.0, 2.925), (8.0, 5.85), (1008.0, 5.85 + 0.3), (6001.0, 0.0)]
)
def test_the_law_of_its_force(deflection_um: float, force_n: float) -> None:
    """Along Z: up to the pretravel in proportion, then with its rate; broken it pushes no more."""
    one = machine()
    record = feelers(one)
    tip_mm = TABLE_MM - 40.0 + 1e-3 * deflection_um
    feel(record, targets(one, TABLE_MM, 3.0), 0.1, 0.1, 1e-3 * tip_mm)
    assert record["push_n"][0].tolist() == pytest.approx([0.0, 0.0, -force_n], abs=1e-6)
    assert bool(record["broken"][0]) == (deflection_um > 6000.0)


@pytest.mark.parametrize("turn_deg", range(0, 360, 20))
def test_the_pretravel_has_three_lobes(turn_deg: float) -> None:
    """What counts of a deflection is less by lobing cos 3 phi, phi: of the push on the tool."""
    one, phi = machine(POST), math.radians(turn_deg)
    record, away_m = feelers(one), 1e-3 * (15.0 + 3.0 - 0.02)
    x_m, y_m = 0.1 + away_m * math.cos(phi), 0.2 + away_m * math.sin(phi)
    feel(record, targets(one, TABLE_MM, 3.0), x_m, y_m, 1e-3 * (TABLE_MM - 40.0 - 20.0))
    assert 1e6 * record["deflected_m"][0] == pytest.approx(20.0 - 3.0 * math.cos(3 * phi), abs=1e-6)
    assert math.hypot(*record["push_n"][0][:2]) == pytest.approx(0.7 + 0.3 * 0.012, rel=1e-6)


def plant(kind: type, one: Machine, start_mm: tuple[float, float, float]) -> Plant:
    feeler = one.feeler
    assert feeler is not None
    watched = [Threshold(0, "touch", feeler.pretravel_mm, 1, feeler.hysteresis_mm)]
    made = kind(one, watched, np.array(start_mm), 4)
    made.set_power(True, True, False)
    return made


def walk(made: Plant, axis: int, steps: int, step_ns: int) -> list[tuple[int, bool]]:
    """Make steps of one axis at an even pace, and go on for 0.1 s; edges: time, touched."""
    begin = made.time_ns
    times = begin + step_ns * np.arange(1, abs(steps) + 1, dtype=np.int64)
    delta = np.zeros((len(times), 4), dtype=np.int8)
    delta[:, axis] = np.sign(steps)
    edges, end, done = [], begin + abs(steps) * step_ns + 100_000_000, 0
    while made.time_ns < end:
        reached = made.advance(end, times[done:], delta[done:])
        done = int(np.searchsorted(times, made.time_ns, side="right"))
        if made.edge:
            edges.append((reached, bool(made.trips()[0])))
    return edges


STEP_MM = 5.0 / 1600


@pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])
def test_it_changes_where_its_law_says(kind: type) -> None:
    """Down onto the table and back, 5 mm/s: 8 um deep, back at 6 um. A plant with physics: less backlash and lag, at
    the place of the tool itself."""
    made = plant(kind, machine(), (150.0, 100.0, 106.5))
    (down, touched), *rest = walk(made, 2, 200, 625_000)
    assert touched
    assert not rest
    if kind is KinematicPlant:
        counts = math.ceil((107.008 - 106.5) / STEP_MM)
        assert down == counts * 625_000
    begin = made.time_ns
    ((free, touched),) = walk(made, 2, -200, 625_000)
    assert not touched
    if kind is KinematicPlant:
        assert free - begin == math.ceil((106.5 + 200 * STEP_MM - 107.006) / STEP_MM) * 625_000


def test_with_physics_the_edge_is_at_the_sub_step_of_the_place() -> None:
    """The tool is at 107.008 mm as well as a sub-step of 25 us at 5 mm/s lets it, and what a structure deflects."""
    made = plant(MujocoPlant, machine(), (150.0, 100.0, 106.5))
    edge_ns = walk(made, 2, 200, 625_000)[0][0]
    again = plant(MujocoPlant, machine(), (150.0, 100.0, 106.5))
    assert edge_ns % 25_000 == 0
    times = 625_000 * np.arange(1, 201, dtype=np.int64)
    delta = np.zeros((200, 4), dtype=np.int8)
    delta[:, 2] = 1
    assert again.advance(10**10, times, delta) == edge_ns
    assert again.position_mm[2] == pytest.approx(107.008, abs=5.0 * 25e-6 * 4)
    assert made.velocity_mm_s[2] == pytest.approx(0.0, abs=1e-3)


def test_the_force_deflects_the_machine() -> None:
    """43 N along X, of 50 N on a turned side: on uprights of 5 N/um and a nut of 30 N/um."""
    ends = []
    for force in (50.0, 0.0):
        numbers = {"probe.force": force, "probe.rate": 0.0, "axes.all.backlash": 0.0}
        made = plant(MujocoPlant, machine(BOX, **numbers), (172.0, 100.0, 95.0))
        walk(made, 0, 1200, 625_000)
        assert made.trips()[0]
        ends.append(made.position_mm[0])
    along_n = 50.0 * math.cos(math.radians(30.0))
    assert ends[1] - ends[0] == pytest.approx(along_n / 5e3 + along_n / 30e3, rel=0.03)


@pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])
def test_it_breaks_beyond_its_overtravel_and_stays_touched(kind: type) -> None:
    made = plant(kind, machine(BOX), (200.0, 100.0, 75.0))
    assert [one for _, one in walk(made, 2, 2800, 156_250)] == [True, True]
    (crash,) = made.take_collisions()
    assert (crash.first, crash.second) == ("probe", "box")
    assert crash.position_mm[2] == pytest.approx(TABLE_MM - 40.0 - 30.0 + 6.0, abs=0.01)
    assert walk(made, 2, -2800, 156_250) == []
    assert made.trips()[0]


@pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])
def test_a_plant_that_was_saved_goes_on_to_the_bit(kind: type) -> None:
    one, other = (plant(kind, machine(), (150.0, 100.0, 106.5)) for _ in range(2))
    walk(one, 2, 163, 625_000)
    other.restore(one.save())
    ends = []
    for made in (one, other):
        edges = walk(made, 2, -30, 625_000)
        ends.append((edges, made.position_mm.tolist(), made.trips().tolist()))
    assert ends[0] == ends[1]
    assert ends[0][0], "it came free"


@pytest.mark.parametrize("cut_ns", [1_000_000, 7_777_777])
def test_it_does_not_matter_how_time_is_cut(cut_ns: int) -> None:
    made = plant(MujocoPlant, machine(), (150.0, 100.0, 106.8))
    whole = walk(plant(MujocoPlant, machine(), (150.0, 100.0, 106.8)), 2, 100, 625_000)
    times = 625_000 * np.arange(1, 101, dtype=np.int64)
    delta = np.zeros((100, 4), dtype=np.int8)
    delta[:, 2] = 1
    edges, reached = [], 0
    while reached < 162_500_000:
        goal = (reached // cut_ns + 1) * cut_ns
        chosen = (times > reached) & (times <= goal)
        reached = made.advance(goal, times[chosen], delta[chosen])
        if made.edge:
            edges.append((reached, bool(made.trips()[0])))
    assert edges == whole


@pytest.mark.parametrize("kind", ["kinematic", "mujoco"])
def test_a_plate_tells_an_imc_the_length_of_its_tool(kind: str) -> None:
    """The host looks at port 1, bit 5: not touched 0.1 mm above the plate, touched 0.1 mm below its top."""
    twin = Twin(plant=kind, controller="imc-s8", machine="4030", start_mm=(20, 20, 20), seed=1, fixtures=(PLATE,))
    for line in ("@07", "@0R7", "@0M 19117,10000,19086,10000,40000,10000,0,1000"):
        assert twin.query(line) == "0"
    above = round((TABLE_MM - 20.0 - twin.machine_position_mm[2] - 0.1) / STEP_MM) + 40_000
    for z, level in ((above, False), (above + 64, True), (above, False)):
        assert twin.query(f"@0M 19117,10000,19086,10000,{z},2000,0,1000") == "0"
        assert twin.levels["p1.5"] is level
    assert twin.collisions == []
    twin.query(f"@0M 19117,10000,19086,10000,{above + 1900},2000,0,1000")
    assert [(one.first, one.second) for one in twin.collisions] == [("cutter", "plate")]


def test_a_broken_wire_of_a_plate() -> None:
    twin = Twin(plant="kinematic", controller="imc-s8", machine="4030", start_mm=(60, 60, 128), fixtures=(PLATE,))
    assert twin.inputs["probe"] == "touched"
    assert twin.levels["p1.5"]
    twin.set_input("probe", "broken")
    assert not twin.levels["p1.5"]


def test_a_probe_in_place_of_the_cutter_meets_what_stands_in_its_way() -> None:
    """The stylus's upper half, 0.9 mm thick on each side, is at the wall before the ball has given way too far."""
    wall = Fixture("wall", "box", (20.0, 100.0, 90.0), (240.0, 100.0, 0.0))
    made = plant(KinematicPlant, machine(wall), (200.0, 100.0, 60.0))
    walk(made, 0, 9600, 31_250)
    (crash,) = made.take_collisions()
    assert (crash.first, crash.second) == ("stylus", "wall")
    assert crash.position_mm[0] == pytest.approx(230.0 - 0.9, abs=STEP_MM)


@pytest.mark.parametrize(
    ("fixture", "words"),
    [
        ({"shape": "ring", "size_mm": (20.0, 30.0, 10.0)}, "the inner diameter of a ring is less than its outer one"),
        ({"shape": "ring", "size_mm": (30.0, 20.0, 10.0), "plate": True}, "a plate is a box or a cylinder"),
        ({"shape": "box", "size_mm": (30.0, 20.0, 10.0), "plate": True, "stock": True}, "a plate is a box or a"),
    ],
)
def test_fixtures_that_cannot_be(fixture: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Fixture("one", **fixture)  # type: ignore[arg-type]


def test_a_lobing_beyond_the_pretravel_is_refused() -> None:
    with pytest.raises(MachineError, match="lobing must not be more than pretravel"):
        machine(**{"probe.lobing": 9.0})
