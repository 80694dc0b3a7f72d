"""Cuts: forces as the closed form of the textbook, and where they show: frame, following, vibration, lost steps."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.native import core
from isel_twin.plant.cutting import CUT, Cut, set_cut, tool_m_per_n
from isel_twin.plant.materials import MATERIALS
from isel_twin.wiring import event_now

from .conftest import MS, Bench, ramp_ns, ticks

SUBSTEP_S = 25e-6
SLOT = Cut(diameter_mm=6.0, flutes=2, depth_mm=0.5, width_mm=6.0, spindle_rpm=6000.0, kc_n_mm2=800.0)


def cut_n(plant):
    """float64 [2], force of the cut on the tool along X and Y in the last sub-step."""
    return np.array([plant.parts.cut["x_n"][0], plant.parts.cut["y_n"][0]])


def mean_n(cut: Cut, feed_mm: float) -> tuple[float, float]:
    """Mean force on the tool along the feed and to its left, N: the integral over the arc of a tooth, times teeth
    (Altintas, 2.2; Kienzle's law and the force of the edge: the head of cutting.py)."""
    from scipy.integrate import quad  # half a second, for this file alone

    engaged = math.acos(1.0 - 2.0 * cut.width_mm / cut.diameter_mm)
    ends = (math.pi - engaged, math.pi) if cut.climb else (0.0, engaged)

    def tangential(phi: float) -> float:
        return cut.depth_mm * (cut.kc_n_mm2 * (feed_mm * math.sin(phi)) ** (1.0 - cut.m) + cut.edge_n_mm)

    def radial(phi: float) -> float:
        edge = cut.edge_radial_n_mm - cut.radial * cut.edge_n_mm
        return cut.radial * tangential(phi) + cut.depth_mm * edge

    along, left = (
        quad(force, *ends)[0]
        for force in (
            lambda phi: -tangential(phi) * math.cos(phi) - radial(phi) * math.sin(phi),
            lambda phi: tangential(phi) * math.sin(phi) - radial(phi) * math.cos(phi),
        )
    )
    return cut.flutes / (2.0 * math.pi) * along, cut.flutes / (2.0 * math.pi) * left


def tooth_mm(cut: Cut, speed_mm_s: float) -> float:
    """Feed of a tooth."""
    return speed_mm_s * 60.0 / (cut.spindle_rpm * cut.flutes)


def bites(cut: Cut, velocity_m_s: Sequence[float], count: int, left: float = 1.0) -> np.ndarray:
    """float64 [count, 2], forces in sub-steps at an even feed, the lag over."""
    cuts = np.zeros(1, CUT)
    set_cut(cuts, cut, 0, SUBSTEP_S, left)
    cuts["x_m_s"], cuts["y_m_s"] = velocity_m_s
    forces = []
    for now in range(count):
        core.bite_once(cuts, now, *velocity_m_s)
        forces.append((cuts["x_n"][0], cuts["y_n"][0]))
    return np.array(forces)


LAWS = [
    {},  # the same kc for all chips
    {"kc_n_mm2": 700.0, "m": 0.25},  # aluminium
    {"kc_n_mm2": 780.0, "m": 0.18},  # brass
    {"kc_n_mm2": 600.0, "radial": 0.2, "edge_n_mm": 20.0, "edge_radial_n_mm": 19.0},  # linear, with its edge
]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("width_mm", [6.0, 3.0, 1.5])
@pytest.mark.parametrize("climb", [True, False])
@pytest.mark.parametrize(("direction", "rpm"), [(0.0, 6000.0), (0.7, 18_000.0), (2.0, 6000.0), (-1.6, 24_000.0)])
def test_mean_force_is_the_integral_over_a_turn(width_mm, climb, direction, rpm, law):
    """4000 sub-steps are ten turns of 400, thirty of 133 or forty of 100, of 3.6 degrees each."""
    cut = dataclasses.replace(SLOT, width_mm=width_mm, climb=climb, spindle_rpm=rpm, **law)
    feed_mm = 0.05
    speed = 1e-3 * feed_mm * rpm / 60.0 * cut.flutes  # m/s
    mean = bites(cut, (speed * math.cos(direction), speed * math.sin(direction)), 4000).mean(axis=0)
    along, leftwards = mean_n(cut, feed_mm)
    ahead, left = (
        np.array([math.cos(direction), math.sin(direction)]),
        np.array([-math.sin(direction), math.cos(direction)]),
    )
    scale = math.hypot(along, leftwards)
    np.testing.assert_allclose(mean, along * ahead + leftwards * left, atol=0.003 * scale)


def test_a_slot_by_hand():
    """N a kc f / 4 across, r times as much against the feed: 2 x 0.5 mm x 800 N/mm2 x 0.1 mm / 4 = 20 N, 6 N."""
    mean = bites(SLOT, (0.02, 0.0), 4000).mean(axis=0)
    np.testing.assert_allclose(mean, (-6.0, 20.0), rtol=1e-3)
    np.testing.assert_allclose(bites(SLOT, (0.02, 0.0), 4000, left=-1.0).mean(axis=0), (-6.0, -20.0), rtol=1e-3)


@pytest.mark.parametrize("feed_mm", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("law", LAWS)
def test_kienzles_law_and_the_force_of_the_edge(feed_mm: float, law: dict[str, float]) -> None:
    """Speed: two teeth, 100 turns a second. The peak is that of one tooth: two in a slot take turns."""
    cut = dataclasses.replace(SLOT, **law)
    forces = bites(cut, (feed_mm * 1e-3 * 200.0, 0.0), 4000)
    np.testing.assert_allclose(forces.mean(axis=0), mean_n(cut, feed_mm), rtol=0.003)
    chip = cut.depth_mm * cut.kc_n_mm2 * feed_mm ** (1.0 - cut.m)
    peak = math.hypot(chip + cut.edge_n_mm * cut.depth_mm, cut.radial * chip + cut.edge_radial_n_mm * cut.depth_mm)
    assert np.hypot(*forces.T).max() == pytest.approx(peak, rel=0.01)


@pytest.mark.parametrize(("feed_mm", "mean", "peak"), [(0.02, 10.2, 19.4), (0.05, 20.3, 38.6), (0.1, 34.2, 65.0)])
def test_a_slot_in_aluminium_as_worked_out_by_hand(feed_mm: float, mean: float, peak: float) -> None:
    """6 mm, two flutes, 0.5 mm deep, 700 N/mm2 and 0.25, a radial force of 0.3."""
    material = MATERIALS["aluminium"]
    cut = dataclasses.replace(SLOT, kc_n_mm2=material.kc1_n_mm2, m=material.m)
    forces = bites(cut, (feed_mm * 1e-3 * 200.0, 0.0), 4000)
    assert math.hypot(*forces.mean(axis=0)) == pytest.approx(mean, rel=0.01)
    assert np.hypot(*forces.T).max() == pytest.approx(peak, rel=0.01)


def test_a_scenario_names_a_material() -> None:
    place = Place("x.toml", ValueError, key="cut")
    of = {"diameter": 6.0, "flutes": 2, "depth": 0.5, "width": 6.0, "spindle": 18_000, "material": "brass"}
    event = event_now({"cut": of}, place, Twin(plant="kinematic").settable)
    cut = event.acts["cut"]
    assert (cut.kc_n_mm2, cut.m) == (780.0, 0.18)
    with pytest.raises(ValueError, match=r"cut\.material: 'cheese'; allowed: aluminium, brass"):
        event_now({"cut": {**of, "material": "cheese"}}, place, Twin(plant="kinematic").settable)
    with pytest.raises(ValueError, match=r"cut\.m: the material says it"):
        event_now({"cut": {**of, "m": 0.2}}, place, Twin(plant="kinematic").settable)


def test_the_power_is_that_of_the_chips():
    """Speed of the edge times tangential force: kc x depth x width x feed speed, summed over one tooth's arc."""
    cut = dataclasses.replace(SLOT, radial=0.0, flutes=1, width_mm=2.0)
    force = bites(cut, (0.02, 0.0), 4000)
    tangential = np.hypot(force[:, 0], force[:, 1])
    edge_m_s = math.pi * 6e-3 * 100.0
    assert (tangential * edge_m_s).mean() == pytest.approx(800e6 * 0.5e-3 * 2e-3 * 0.02, rel=0.003)


@pytest.mark.parametrize("start", [0, 1234])
@pytest.mark.parametrize("left", [1.0, -1.0])
def test_every_tooth_begins_on_the_left_when_the_cut_begins(start, left):
    """One tooth in a slot, no radial force, one turn: phi = 2 pi (n + 1/2) / 400 in the middle of the n-th sub-step,
    F_t = kc a v T sin(phi) against its way, -F_t cos(phi) along the feed, +F_t sin(phi) to its left; none behind."""
    cut = dataclasses.replace(SLOT, radial=0.0, flutes=1)
    cuts = np.zeros(1, CUT)
    set_cut(cuts, cut, start, SUBSTEP_S, left)
    cuts["y_m_s"] = 0.02
    for n in range(400):
        core.bite_once(cuts, start + n, 0.0, 0.02)
        phi = 2.0 * math.pi * (n + 0.5) / 400.0
        tangential_n = 800e6 * 0.5e-3 * 0.02 * 0.01 * max(0.0, math.sin(phi))
        expected = (-left * tangential_n * math.sin(phi), -tangential_n * math.cos(phi))
        np.testing.assert_allclose((cuts["x_n"][0], cuts["y_n"][0]), expected, atol=1e-9)


@pytest.mark.parametrize("way", [(0.02, 0.0), (0.0, 0.02), (-0.016, 0.012)])
def test_a_chip_is_the_way_of_a_whole_tooth(way):
    """The feed has a lag of T, 5 ms of two teeth at 6000 a minute: after T 1 - 1/e of it, and of the force."""
    cuts = np.zeros(1, CUT)
    set_cut(cuts, dataclasses.replace(SLOT, flutes=2), 0, SUBSTEP_S, 1.0)
    for now in range(200):
        core.bite_once(cuts, now, *way)
    share = 1.0 - math.exp(-1.0)
    np.testing.assert_allclose((cuts["x_m_s"][0], cuts["y_m_s"][0]), share * np.array(way), rtol=1e-12, atol=1e-18)
    force_n = np.array([cuts["x_n"][0], cuts["y_n"][0]])
    np.testing.assert_allclose(force_n, share * bites(SLOT, way, 200)[-1], rtol=1e-9)


@pytest.mark.parametrize("climb", [True, False])
def test_a_sum_of_a_window_is_what_its_sub_steps_made(climb):
    """What has been summed up stays when the cut ends amid a window."""
    cuts = np.zeros(1, CUT)
    set_cut(cuts, dataclasses.replace(SLOT, climb=climb), 0, SUBSTEP_S, 1.0)
    forces = []
    for now in range(20):
        core.bite_once(cuts, now, 0.02, 0.01)
        forces.append((cuts["x_n"][0], cuts["y_n"][0]))
    total = np.sum(forces, axis=0)
    set_cut(cuts, None, 20, SUBSTEP_S, 1.0)
    assert not cuts["on"][0]
    np.testing.assert_allclose((cuts["sum_x_n"][0], cuts["sum_y_n"][0]), total, rtol=1e-12)
    assert [cuts[name][0] for name in ("x_m_s", "y_m_s", "x_n", "y_n")] == [0.0] * 4


def test_no_chip_is_thicker_than_the_radius():
    """3 mm a tooth at most: 200 teeth a second take all of 0.6 m/s, and of 2 m/s no more."""
    most = bites(SLOT, (0.6, 0.0), 400)
    np.testing.assert_allclose(bites(SLOT, (2.0, 0.0), 400), most, rtol=1e-12)
    np.testing.assert_allclose(bites(SLOT, (0.3, 0.0), 400), 0.5 * most, rtol=1e-12)


def test_no_chip_without_feed():
    """Below 1 um/s a tooth rubs."""
    assert not bites(SLOT, (0.6e-6, 0.6e-6), 400).any()
    assert bites(SLOT, (0.8e-6, 0.8e-6), 400).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width_mm": 7.0}, "cut: width must be at most the diameter, 6 mm, not 7.0"),
        ({"shank_mm": 6.0}, "cut: shank and flute_length are those of a tool that bends; give its stickout, too"),
        ({"tool_material": "wood"}, "cut: tool_material must be one of carbide, hss, not 'wood'"),
        ({"flutes": 0}, "cut: flutes must lie in 1 .. 12, not 0"),
        ({"flutes": 2.5}, "cut: flutes must be a whole number, not 2.5"),
        ({"spindle_rpm": 1e6}, "cut: spindle_rpm must lie in 60 .. 60000, not 1000000.0"),
    ],
)
def test_a_wrong_cut_is_named(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(SLOT, **changes)


def test_what_is_not_said_of_a_cut_is_that_it_climbs_and_presses_with_three_tenths():
    cut = Cut(6.0, 2, 0.5, 3.0, 6000.0, 800.0)
    assert (cut.radial, cut.climb) == (0.3, True)
    with pytest.raises(dataclasses.FrozenInstanceError):
        cut.depth_mm = 1.0  # type: ignore[misc]


FREE = {f"axes.all.{key}": 0.0 for key in ("shaft_coulomb", "guide_friction", "backlash")}


def feed_x(b: Bench, hz: float, seconds: float) -> None:
    """Feed along X at an even rate; 320 steps are a millimetre."""
    t_ns = (np.arange(1, round(hz * seconds) + 1) * (1e9 / hz)).astype(np.int64)
    b.feed(round(seconds * 1e9), t_ns, ticks(len(t_ns), 1))


def sampled(b: Bench, hz: float, seconds: float, look) -> np.ndarray:
    """look() every ms of a feed along X; float64 [seconds in ms, ...]."""
    seen = []
    for _ in range(round(1e3 * seconds)):
        feed_x(b, hz, 1e-3)
        seen.append(look())
    return np.array(seen)


def test_tool_and_table_are_pushed_apart_and_the_frame_gives(bench):
    """20 mm/s in X: on the tool 20 N to the left (Y, the portal nods) and as much on the table the other way."""
    b = bench(FREE, lowering=False)
    feed_x(b, 6000.0, 0.5)
    before = b.plant.data.qpos.copy()
    b.plant.set_cut(SLOT)
    feed_x(b, 6000.0, 1.5)
    seen = sampled(b, 6000.0, 1.0, lambda: np.append(b.plant.data.qpos - before, cut_n(b.plant)))
    names = [b.plant.model.joint(j).name for j in range(b.plant.model.njnt)]
    give_um = dict(zip(names, 1e6 * seen.mean(axis=0), strict=False))
    along, across = mean_n(SLOT, tooth_mm(SLOT, 6000.0 / 320.0))
    assert give_um["nod_y"] == pytest.approx(across / 5.0, rel=0.03)
    assert give_um["flex_y"] == pytest.approx(across / 8.0, rel=0.03)
    assert give_um["flex_x"] == pytest.approx(along / 5.0, rel=0.1)
    tool, table = (b.plant.model.joint(name).axis for name in ("nod_y", "flex_y"))
    assert tool[1] == -table[1], "apart, in the world"


def test_teeth_shake_the_frame_at_their_own_frequency(bench):
    """Two teeth in a slot push across with a pure tone, F (1 - cos 2 phi - r sin 2 phi): one mass on its spring."""
    cut = dataclasses.replace(SLOT, spindle_rpm=3600.0)
    b = bench(FREE, lowering=False)
    b.plant.set_cut(cut)
    feed_x(b, 6000.0, 1.5)
    joint = b.plant.model.joint("nod_y").qposadr[0]
    swing = sampled(b, 6000.0, 1.0, lambda: b.plant.data.qpos[joint])
    tone = 2.0 * np.abs(np.fft.rfft(swing - swing.mean())) / len(swing)
    assert tone.argmax() == 120, "two teeth, 60 turns a second, bins of 1 Hz"
    _, across = mean_n(cut, tooth_mm(cut, 6000.0 / 320.0))
    ratio = 120.0 / (math.sqrt(5e6 / 32.0) / (2.0 * math.pi))
    grown = 1.0 / math.hypot(1.0 - ratio**2, 2.0 * 0.03 * ratio)
    assert tone.max() == pytest.approx(math.hypot(1.0, 0.3) * across / 5e6 * grown, rel=0.05)


def test_a_cut_shows_in_the_following_error(bench):
    """Against the feed: r F; the motor lags by more, as at standstill (asin), for the torque at its shaft."""
    cut = dataclasses.replace(SLOT, depth_mm=3.0, radial=1.0, spindle_rpm=12_000.0)
    b = bench({**FREE, "axes.all.efficiency": 1.0}, lowering=False)
    feed_x(b, 3200.0, 0.5)
    before = sampled(b, 3200.0, 0.5, lambda: b.plant.lag[0]).mean()
    b.plant.set_cut(cut)
    feed_x(b, 3200.0, 0.5)
    more = sampled(b, 3200.0, 0.5, lambda: b.plant.lag[0]).mean() - before
    along, _ = mean_n(cut, tooth_mm(cut, 3200.0 / 320.0))
    torque_nm = -along * 5e-3 / (2.0 * math.pi)
    stiffness = 50 * 0.424 * 4.2
    assert more == pytest.approx(torque_nm / stiffness * 1600 / (2.0 * math.pi), rel=0.1)


@pytest.mark.parametrize(("spindle_rpm", "loses"), [(6000.0, False), (120.0, True)])
def test_a_spindle_too_slow_for_its_feed_loses_steps(bench, spindle_rpm, loses):
    """31 mm/s, 1 mm deep: 62 N against the feed at 6000 turns a minute, 3 kN at 120, where the motor pulls 2 kN."""
    b = bench()
    b.plant.set_cut(dataclasses.replace(SLOT, depth_mm=1.0, radial=1.0, spindle_rpm=spindle_rpm))
    b.move((6400, 0, 0), 10_000)
    b.plant.set_cut(None)
    b.wait(1000)
    assert (abs(b.lost[0]) > 16) == loses


def test_no_bit_depends_on_how_time_is_cut(bench):
    t_ns = ramp_ns(3200, 8000)
    end_ns = int(t_ns[-1]) + 300_000_000

    def run(cuts_ns: list[int]) -> bytes:
        b = bench()
        b.plant.set_cut(SLOT)
        done_ns, start_ns = 0, b.now_ns
        for until_ns in [*cuts_ns, end_ns]:
            mine = t_ns[(t_ns > done_ns) & (t_ns <= until_ns)]
            assert b.plant.advance(start_ns + until_ns, start_ns + mine, ticks(len(mine), 1, 1)) == start_ns + until_ns
            done_ns = until_ns
        state = (b.plant.position_mm, b.plant.rotor, b.plant.data.qpos, b.plant.data.qvel, cut_n(b.plant))
        return b"".join(part.tobytes() for part in state)

    random = np.random.default_rng(1)
    whole = run([])
    assert run(np.sort(random.integers(1, end_ns, 40)).tolist()) == whole


def test_a_spindle_in_the_material_of_a_machine_at_rest_does_nothing(bench):
    """No feed, no chip: the plant comes to rest, and time is skipped; off again nothing is left."""
    b = bench()
    b.plant.set_cut(SLOT)
    b.move((320, 320, 0), 3000)
    b.wait(2000)
    assert b.plant.at_rest
    assert not cut_n(b.plant).any()
    place = b.plant.position_mm
    b.wait(3_600_000)
    b.plant.set_cut(None)
    b.wait(1000)
    assert b.plant.at_rest
    np.testing.assert_allclose(b.plant.position_mm, place, atol=2e-5, err_msg="20 nm of swing were cut off")


def test_left_of_the_feed_is_left_in_the_world(bench):
    """On the traverse Y points to the front: the same cut pushes towards minus Y."""
    for name, sign in (("4030", 1.0), ("traverse", -1.0)):
        b = bench(machine=name)
        b.plant.set_cut(SLOT)
        feed_x(b, 6000.0, 0.5)
        assert sign * sampled(b, 6000.0, 0.2, lambda b=b: cut_n(b.plant)[1]).mean() > 5.0


THIN = dataclasses.replace(SLOT, diameter_mm=3.0, width_mm=3.0, stickout_mm=20.0)


def test_a_smooth_pin_is_a_cantilever_of_the_textbook() -> None:
    """k = 3 E I / L^3 = 3 x 600 GPa x pi (3 mm)^4 / 64 / (20 mm)^3 = 0.895 N/um; of steel 210/600 of that."""
    pin = dataclasses.replace(THIN, flute_length_mm=1e-6)
    assert 1e-6 / tool_m_per_n(pin, math.inf) == pytest.approx(0.895, abs=0.001)
    assert 1e-6 / tool_m_per_n(dataclasses.replace(pin, tool_material="hss"), math.inf) == pytest.approx(
        0.313, abs=0.001
    )
    assert tool_m_per_n(dataclasses.replace(pin, stickout_mm=0.0, flute_length_mm=0.0), 1e6) == 0.0


@pytest.mark.parametrize(
    ("tool", "fluted_mm", "shank_mm"),
    [
        ({}, 7.5, 3.0),  # two and a half diameters
        ({"flute_length_mm": 12.0, "shank_mm": 6.0}, 12.0, 6.0),
        ({"flute_length_mm": 40.0}, 20.0, 3.0),  # fluted into the collet
    ],
)
def test_flutes_and_shank_give_way_by_castigliano(tool: dict[str, float], fluted_mm: float, shank_mm: float) -> None:
    """The integral of x^2 / E I along the tool; the fluted part as a shaft of 0.8 of the diameter. 10 N/um of the
    holder are in series."""
    x_mm = (np.arange(20_000) + 0.5) * 1e-3
    thick_mm = np.where(x_mm < fluted_mm, 0.8 * 3.0, shank_mm)
    alone = (x_mm**2 / (600e3 * math.pi * thick_mm**4 / 64.0)).sum() * 1e-3  # mm/N
    cut = dataclasses.replace(THIN, **tool)
    assert tool_m_per_n(cut, math.inf) == pytest.approx(1e-3 * alone, rel=1e-6)
    assert tool_m_per_n(cut, 10e6) == pytest.approx(1e-3 * alone + 1e-7, rel=1e-6)


@pytest.mark.parametrize(("machine", "left"), [("4030", 1.0), ("4030-servo", 1.0), ("traverse", -1.0)])
def test_a_tool_bends_as_the_mean_force_pushes_it_and_springs_back(bench, machine: str, left: float) -> None:
    """18.75 mm/s in X, with a tool that bends and without: they differ by F / k, in samples and at the end,
    and by nothing when it is over."""
    flown = []
    for stickout_mm in (20.0, 0.0):
        b = bench({**FREE, "holder.stiffness": 10.0}, machine=machine, lowering=False)
        b.plant.set_cut(dataclasses.replace(THIN, stickout_mm=stickout_mm))
        per_mm = b.plant.machine.axes[0].steps_per_mm
        feed_x(b, 18.75 * per_mm, 0.2)
        b.plant.sample_every(MS)
        feed_x(b, 18.75 * per_mm, 0.2)
        samples = b.plant.take_samples()
        np.testing.assert_array_equal(samples.position_mm[-1], b.plant.position_mm)
        b.plant.sample_every(0)
        b.wait(2000)
        flown.append((samples.position_mm, samples.velocity_mm_s, b.plant.position_mm))
    (bent_mm, velocity, stood_mm), (stiff_mm, stiff_velocity, stiff_stood_mm) = flown
    along, across = mean_n(THIN, tooth_mm(THIN, 18.75))
    um_per_n = 1.2027 + 1.0 / 10.0  # by Castigliano, see above
    give_um = 1e3 * (bent_mm - stiff_mm).mean(axis=0)
    np.testing.assert_allclose(
        give_um, (along * um_per_n, left * across * um_per_n, 0.0), atol=0.01 * across * um_per_n
    )
    np.testing.assert_array_equal(velocity, stiff_velocity, err_msg="forces are what they were")
    np.testing.assert_allclose(stood_mm, stiff_stood_mm, atol=2e-5)


def test_a_bent_tool_is_back_before_the_machine_rests(bench) -> None:
    """One turn a second, and a blunt edge that lets go at once when the feed is over: the tip comes back by a lag of a
    second, without a leap at the moment at which time begins to be skipped."""
    b = bench(FREE)
    blunt = {"kc_n_mm2": 1.0, "edge_n_mm": 2.0}
    b.plant.set_cut(dataclasses.replace(THIN, flutes=1, spindle_rpm=60.0, stickout_mm=60.0, **blunt))
    feed_x(b, 3200.0, 1.5)
    y_mm = [b.plant.position_mm[1]]
    while not b.plant.at_rest:
        b.wait(100)
        y_mm.append(b.plant.position_mm[1])
    steps_um = np.abs(1e3 * np.diff(y_mm))
    assert steps_um.max() > 1.0
    assert steps_um[-1] < 0.02
