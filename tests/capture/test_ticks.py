"""Edges to ticks, by hand; what a drive would not take for sure; the player behind it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin import Twin
from isel_twin.capture.mapping import parse_map
from isel_twin.capture.player import GAP_NS, Player
from isel_twin.capture.ticks import Needs, Offence, Ticks, ticks_of
from isel_twin.capture.wave import Capture, Wave
from tests.thorough import drawn


def wave(*t_ns: int, first: bool = False) -> Wave:
    return Wave(first, np.array(t_ns, dtype=np.int64))


def made(text: str, edge: str = "rising", needs: Needs | None = None, **waves: Wave) -> Ticks:
    return ticks_of(Capture(waves, 10**6, 0.0), parse_map([text]), needs or Needs(), edge)


def rows(ticks: Ticks) -> list[tuple[int, list[int]]]:
    return list(zip(ticks.t_ns.tolist(), ticks.delta.tolist(), strict=True))


def test_axes_that_step_at_one_time_are_one_tick() -> None:
    ticks = made("x.step=a,x.dir=b,z.step=c,z.dir=!b", a=wave(10, 12, 30, 32), b=wave(20), c=wave(30, 31, 40, 41))
    assert rows(ticks) == [(10, [-1, 0, 0]), (30, [1, 0, -1]), (40, [0, 0, -1])]


@pytest.mark.parametrize(("edge", "times"), [("rising", [10, 30]), ("falling", [12, 32]), ("both", [10, 12, 30, 32])])
def test_the_active_edge(edge: str, times: list[int]) -> None:
    assert made("x.step=a,x.dir=b", edge, a=wave(10, 12, 30, 32), b=wave()).t_ns.tolist() == times


def test_an_inverted_step_counts_at_its_falling_edges() -> None:
    assert made("x.step=!a,x.dir=b", a=wave(10, 12, 30, 32, first=True), b=wave()).t_ns.tolist() == [10, 30]


def test_one_signal_may_drive_two_axes() -> None:
    ticks = made("x.step=a,x.dir=b,a.step=a,a.dir=!b", a=wave(10, 12), b=wave())
    assert rows(ticks) == [(10, [-1, 0, 0, 1])]


def test_two_pulse_drives() -> None:
    ticks = made("y.plus=a,y.minus=b", a=wave(10, 5000, 9000, 12_000), b=wave(6000, 8000))
    assert rows(ticks) == [(10, [0, 1, 0]), (6000, [0, -1, 0]), (9000, [0, 1, 0])]
    assert ticks.timing["y"].short_pulses is None
    assert ticks.timing["y"].setup is None


def test_a_direction_that_turns_with_the_step_counts_as_before_it_and_is_told() -> None:
    ticks = made("x.step=a,x.dir=b", a=wave(5000, 9000), b=wave(5000))
    assert rows(ticks) == [(5000, [1, 0, 0])]
    assert ticks.timing["x"].setup == Offence(1, 0, 5000)


def test_what_is_too_short_is_counted() -> None:
    """Pulses of 2000, 1899, 1900 ns and pauses of 1000, 101 ns at the limit of 1900; dir 650 and 649 ns before, 650 and
    649 after a step at the limits of 650."""
    ticks = made(
        "x.step=a,x.dir=b",
        a=wave(10_000, 12_000, 13_000, 14_899, 15_000, 16_900, 30_000, 33_000, 40_000, 43_000),
        b=wave(9350, 10_650, 29_351, 40_649),
    )
    timing = ticks.timing["x"]
    assert timing.short_pulses == Offence(1, 1899, 14_899)
    assert timing.short_pauses == Offence(2, 101, 13_000)
    assert timing.setup == Offence(1, 649, 30_000)
    assert timing.hold == Offence(1, 649, 40_000)
    assert (timing.steps, timing.fastest_hz) == (5, 500_000.0)


def test_limits_can_be_said() -> None:
    waves = {"a": wave(10_000, 12_500, 20_000, 25_000), "b": wave(5001)}
    assert made("x.step=a,x.dir=b", **waves).timing["x"].setup is None
    timing = made("x.step=a,x.dir=b", needs=Needs(2501, 5000, 5000), **waves).timing["x"]  # of a DM542T, about
    assert timing.setup == Offence(1, 4999, 10_000)
    assert timing.short_pulses == Offence(1, 2500, 12_500)


def test_an_inverted_step_is_short_where_it_is_low() -> None:
    timing = made("x.step=!a,x.dir=b", a=wave(10_000, 10_100, first=True), b=wave()).timing["x"]
    assert timing.short_pulses == Offence(1, 100, 10_100)


def test_enable_is_told_and_steps_without_it_are_counted() -> None:
    ticks = made("x.step=a,x.dir=b,enable=!e", a=wave(10, 20, 30, 40, 50, 60), b=wave(), e=wave(25, 45, first=True))
    assert ticks.timing["x"].while_off == 2
    assert [change for change in ticks.outputs if change[1] == "stages"] == [
        (0, "stages", 0), (25, "stages", 1), (45, "stages", 0),
    ]  # fmt: skip
    assert {name for _, name, _ in ticks.outputs} == {"stages", "brake"}


def test_without_enable_the_stages_are_on() -> None:
    ticks = made("x.step=a,x.dir=b", a=wave(10, 20), b=wave())
    assert ticks.outputs == ((0, "stages", 1), (0, "brake", 1))


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 10**6), st.booleans()), min_size=1, max_size=40),
    st.lists(st.integers(1, 10**6), max_size=10),
    st.integers(0, 10**6),
)
def test_ticks_are_what_a_drive_would_count(pulses: list[tuple[int, bool]], turns: list[int], at: int) -> None:
    """A drive that looks at dir at each rising edge of step, nanosecond by nanosecond."""
    step = np.cumsum([gap for gap, _ in pulses])
    direction = np.cumsum([*turns, 1])[:-1]
    ticks = made("x.step=a,x.dir=b", a=wave(*step), b=wave(*direction))
    count, level, high = 0, False, False
    for t in sorted({*step.tolist(), *direction.tolist()}):
        level ^= t in direction
        if t in step:
            high = not high
            count += (1 if level else -1) * high
    assert ticks.delta.sum(axis=0).tolist() == [count, 0, 0]
    assert made("x.step=a,x.dir=!b", a=wave(*step), b=wave(*direction)).delta[:, 0].sum() == -count


# ---- player ----------------------------------------------------------------------------------------------------------


@st.composite
def streams(draw: st.DrawFn) -> Ticks:
    gaps = draw(st.lists(st.one_of(st.integers(0, 10**6), st.integers(10**7, 3 * 10**8)), min_size=1, max_size=60))
    axes = draw(st.integers(1, 4))
    delta = draw(
        st.lists(st.lists(st.integers(-1, 1), min_size=axes, max_size=axes), min_size=len(gaps), max_size=len(gaps))
    )
    t_ns = np.cumsum(np.array(gaps, dtype=np.int64))
    return Ticks(t_ns, np.array(delta, dtype=np.int8), int(t_ns[-1]))


@settings(max_examples=drawn(40), deadline=None)
@given(streams(), st.lists(st.integers(1, 10**9), max_size=4))
def test_a_twin_makes_every_tick_of_a_player_however_time_is_cut(ticks: Ticks, cuts: list[int]) -> None:
    player = Player(ticks)
    twin = Twin(controller=player, plant="kinematic", start_mm=(100, 100, 50))
    for cut in cuts:
        twin.run_until(twin.time_ns + cut)
        made = int(np.searchsorted(ticks.t_ns, twin.time_ns, side="right"))
        assert twin.counts.tolist() == ticks.delta[:made].sum(axis=0).tolist()
    twin.run_until(ticks.end_ns + 1)
    assert twin.steps.t_ns.tolist() == ticks.t_ns.tolist()
    assert twin.steps.delta.tolist() == ticks.delta.tolist()
    assert len(player.motions) == 1 + int((np.diff(ticks.t_ns) >= GAP_NS).sum())
    assert twin.idle


def test_a_long_motion_is_summed_in_blocks() -> None:
    delta = np.random.default_rng(1).integers(-1, 2, (20_000, 3)).astype(np.int8)
    path = Player(Ticks(np.arange(1, 20_001), delta, 20_000)).motions[0].path
    for k in (0, 1, 4095, 4096, 4097, 8192, 19_999, 20_000):
        assert path.displacement(k) == tuple(delta[:k].sum(axis=0).tolist())
    for k in (-1, 20_001):
        with pytest.raises(IndexError):
            path.displacement(k)


def test_a_twin_of_a_built_controller_has_no_language() -> None:
    twin = Twin(controller=Player(Ticks(np.array([5]), np.ones((1, 3), dtype=np.int8), 5)), plant="kinematic")
    assert (twin.language, twin.controller_name) == (None, "player")
