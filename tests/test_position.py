"""Counters, rotors and carriages against arithmetic on paper: a plant and a controller that are only numbers.

One axis: the controller has made n steps in its own sense since power-on, d is its direction, the motor has slipped k
periods of 32 steps against the command since then and is turned by e steps by its load. Then

    commanded = d n        rotor = d n - 32 k - e        carriage = start + rotor step + whatever bends
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from by_hand import PlantByHand
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.core.position import Position, position_error_mm

START_MM = (100.0, 50.0, 30.0)
STEP_MM = np.array([1 / 320, 1 / 320, 1 / 400])
PERIOD = 32


@dataclass
class Believer:
    """What a `Position` asks of a controller."""

    counts: tuple[int, ...]
    direction: tuple[int, ...]


class Axes:
    """A controller, its plant and the position between them."""

    def __init__(self, *direction: int, periods: Sequence[float] = ()) -> None:
        self.plant = PlantByHand(axes=len(direction))
        self.plant.slip_steps[: len(periods)] = periods
        self.plant.position_mm[:] = START_MM
        self.controller = Believer((0,) * len(direction), direction)
        self.position = Position(self.controller, self.plant, STEP_MM)  # type: ignore[arg-type]

    def turn(self, axis: int, steps: float) -> None:
        """The rotor turns, and the carriage with it, in the sense of the motor."""
        self.plant.rotor[axis] += steps
        if axis < 3:
            self.plant.position_mm[axis] += steps * STEP_MM[axis]

    def move(self, axis: int, steps: int) -> None:
        """Make steps in the sense of the counter; the motor follows."""
        counts = list(self.controller.counts)
        counts[axis] += steps
        self.controller.counts = tuple(counts)
        self.plant.commanded[axis] += self.controller.direction[axis] * steps
        self.plant.command[axis] = self.plant.commanded[axis]
        self.turn(axis, self.controller.direction[axis] * steps)

    def set(self, axis: int, value: int) -> None:
        """The controller sets a counter and says so."""
        counts = list(self.controller.counts)
        counts[axis] = value
        self.controller.counts = tuple(counts)
        self.position.counter_set(axis, value)

    @property
    def mm(self) -> list[float]:
        return np.round(self.position.position_mm, 9).tolist()

    @property
    def lost(self) -> list[float]:
        return np.round(self.position.lost_steps, 9).tolist()

    @property
    def forgotten(self) -> list[float]:
        return np.round(self.position.forgotten_steps, 9).tolist()


def test_at_power_on_everything_is_zero_where_it_stands() -> None:
    axes = Axes(1, 1, 1, 1)
    assert axes.position.counts.tolist() == [0, 0, 0, 0]
    assert axes.position.counts.dtype == np.int64
    assert (axes.mm, axes.lost, axes.forgotten) == ([0.0] * 3, [0.0] * 4, [0.0] * 4)
    assert axes.position.error_mm.tolist() == [0.0] * 3
    assert axes.position.encoder == (0, 0, 0, 0)
    assert axes.position.slip_steps.tolist() == [32.0] * 4


@pytest.mark.parametrize("direction", [1, -1])
def test_the_carriage_is_shown_in_the_direction_of_its_counter(direction: int) -> None:
    """3200 steps of 1/320 mm are 10 mm, whichever way the motor turns for them."""
    axes = Axes(direction, 1, 1, 1)
    axes.move(0, 3200)
    assert axes.plant.position_mm[0] == pytest.approx(100.0 + direction * 10.0)
    assert axes.mm == [10.0, 0.0, 0.0]
    assert axes.position.encoder == (3200, 0, 0, 0)
    axes.plant.position_mm[0] += 0.25
    assert axes.mm[0] == pytest.approx(10.0 + direction * 0.25)
    assert axes.position.error_mm.tolist() == pytest.approx([direction * 0.25, 0.0, 0.0])


@pytest.mark.parametrize("direction", [1, -1])
def test_a_counter_that_is_set_moves_the_zero(direction: int) -> None:
    """10 mm gone, then this place is called 5 mm (1600 steps): zero is 5 mm before it."""
    axes = Axes(direction, 1, direction, 1)
    axes.move(0, 3200)
    axes.move(2, -400)
    axes.set(0, 1600)
    assert axes.mm == pytest.approx([5.0, 0.0, -1.0])
    assert axes.position.encoder == (1600, 0, -400, 0)
    assert axes.lost == [0.0] * 4
    axes.move(0, -1600)
    assert axes.mm == pytest.approx([0.0, 0.0, -1.0])
    assert axes.plant.position_mm[0] == pytest.approx(100.0 + direction * 5.0)
    assert np.abs(axes.position.error_mm).max() < 1e-9


@pytest.mark.parametrize("direction", [1, -1])
def test_a_pulse_that_is_counted_and_not_given_yet_moves_nothing(direction: int) -> None:
    """Drives know whole sub-steps, the controller each nanosecond: in between they differ by a pulse, also when a
    counter is set."""
    axes = Axes(direction, 1, 1, 1)
    axes.move(0, 3200)
    axes.controller.counts = (3201, 0, 0, 0)
    axes.plant.late[0] = direction
    assert axes.mm == [10.0, 0.0, 0.0]
    axes.set(0, 0)
    assert axes.mm == pytest.approx([-1 / 320, 0.0, 0.0]), "the last pulse has not been made"
    axes.plant.late[0] = 0
    axes.plant.commanded[0] += direction
    axes.turn(0, direction)
    assert axes.mm == [0.0, 0.0, 0.0]
    assert axes.position.encoder[0] == 0


@pytest.mark.parametrize("direction", [1, -1])
def test_an_axis_that_was_turned_round_has_its_zero_from_the_next_setting_of_any_counter(direction: int) -> None:
    """Counters are set at rest: 10 mm gone and turned round, X is at 10 mm on the other side of its zero. A pulse that
    is counted then, and that no drive has been told of, moves nothing, though nobody has looked before."""
    axes = Axes(direction, 1, 1, 1)
    axes.move(0, 3200)
    axes.controller.direction = (-direction, 1, 1, 1)
    axes.set(1, 500)
    axes.controller.counts = (3201, 500, 0, 0)
    assert axes.mm == pytest.approx([10.0, 500 / 320, 0.0])


@pytest.mark.parametrize("direction", [1, -1])
def test_zero_is_where_the_carriage_stands_in_balance(direction: int) -> None:
    """Bent by 0.01 mm and a load angle of 3 steps at the moment the counter is set: zero is where it would be without
    either, and both show."""
    axes = Axes(1, direction, 1, 1)
    axes.move(1, 640)
    axes.plant.position_mm[1] += 0.01
    axes.turn(1, -3.0)
    axes.set(1, 0)
    assert axes.mm == pytest.approx([0.0, direction * (0.01 - 3 / 320), 0.0])
    assert axes.lost == pytest.approx([0.0, direction * 3.0, 0.0, 0.0])
    axes.plant.position_mm[1] -= 0.01
    axes.turn(1, 3.0)
    assert (axes.mm, axes.lost) == ([0.0] * 3, [0.0] * 4)


@pytest.mark.parametrize("direction", [1, -1])
def test_lost_steps_are_counter_minus_rotor(direction: int) -> None:
    """Two slips against the motion: the counter is 64 ahead of the rotor, whichever way the motor turns."""
    axes = Axes(1, 1, direction, 1)
    axes.move(2, 1000)
    axes.turn(2, -direction * 2 * PERIOD)
    assert axes.lost == [0.0, 0.0, 64.0, 0.0]
    assert axes.mm == pytest.approx([0.0, 0.0, (1000 - 64) / 400])
    assert axes.position.encoder == (0, 0, 936, 0)
    assert axes.forgotten == [0.0] * 4


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(
    ("behind", "slips"),
    [
        (0.0, 0),
        (15.5, 0),
        (-15.5, 0),
        (16.5, 1),
        (32.0, 1),
        (40.0, 1),
        (-40.0, -1),
        (47.5, 1),
        (48.5, 2),
        (-330.0, -10),
    ],
)
def test_whole_slips_are_forgotten_when_the_counter_is_set(direction: int, behind: float, slips: int) -> None:
    """What stays lost is at most half a period; the rest is counted, whichever way it was lost."""
    axes = Axes(direction, 1, 1, 1)
    axes.move(0, 5000)
    axes.turn(0, -direction * behind)
    axes.set(0, 0)
    assert axes.forgotten == [abs(slips) * PERIOD, 0.0, 0.0, 0.0]
    assert axes.lost == [behind - slips * PERIOD, 0.0, 0.0, 0.0]
    assert axes.mm[0] == pytest.approx(-(behind - slips * PERIOD) / 320)
    assert axes.position.encoder[0] == pytest.approx(-(behind - slips * PERIOD), abs=0.5)


def test_slips_are_forgotten_axis_by_axis() -> None:
    axes = Axes(1, -1, 1, 1, -1)
    for axis, direction in enumerate(axes.controller.direction):
        axes.move(axis, 100)
        axes.turn(axis, -direction * PERIOD)
    axes.set(1, 0)
    axes.set(4, 77)
    assert axes.lost == [32.0, 0.0, 32.0, 32.0, 0.0]
    assert axes.forgotten == [0.0, 32.0, 0.0, 0.0, 32.0]
    assert axes.position.encoder == (68, 0, 68, 68, 77)


def test_the_period_is_that_of_each_motor() -> None:
    axes = Axes(1, 1, 1, 1, periods=(32.0, 8.0, 4.0, 1.0))
    for axis in range(4):
        axes.turn(axis, -10.0)
        axes.set(axis, 0)
    assert axes.position.slip_steps.tolist() == [32.0, 8.0, 4.0, 1.0]
    assert axes.forgotten[0] == 0.0
    assert axes.forgotten[1] == 8.0
    assert axes.forgotten[3] == 10.0
    assert axes.lost[2] in (2.0, -2.0), "half a period, either way"


def test_axes_beyond_the_carriages_have_counters_and_losses() -> None:
    axes = Axes(1, 1, 1, -1, 1, -1)
    for axis in range(3, 6):
        axes.move(axis, 10 * axis)
    assert axes.mm == [0.0] * 3
    assert axes.position.encoder == (0, 0, 0, 30, 40, 50)
    assert axes.position.counts.tolist() == [0, 0, 0, 30, 40, 50]
    axes.turn(5, PERIOD)
    assert axes.lost == [0.0] * 5 + [32.0]
    axes.set(5, 0)
    assert (axes.lost, axes.forgotten) == ([0.0] * 6, [0.0] * 5 + [32.0])
    assert axes.position.error_mm.tolist() == [0.0] * 3


@pytest.mark.parametrize("count", [1, 2])
def test_a_controller_with_fewer_axes_than_there_are_carriages(count: int) -> None:
    """The others should stand where they were; when somebody pushes one, that is an error of as much."""
    axes = Axes(*[-1] * count)
    axes.move(0, 320)
    assert axes.mm == [1.0, 0.0, 0.0]
    assert len(axes.lost) == len(axes.position.encoder) == len(axes.position.counts) == count
    axes.plant.position_mm[2] += 0.5
    assert axes.mm == [1.0, 0.0, 0.5]
    assert axes.position.error_mm.tolist() == pytest.approx([0.0, 0.0, 0.5])
    axes.set(0, 0)
    assert axes.mm == [0.0, 0.0, 0.5]


@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
@pytest.mark.parametrize("axes", [1, 2, 3, 4, 8])
def test_errors_of_many_moments_at_once(shape: tuple[int, ...], axes: int) -> None:
    random = np.random.default_rng(axes)
    position = random.normal(size=(*shape, 3))
    counts = random.integers(-1000, 1000, (*shape, axes))
    error = position_error_mm(position, counts, STEP_MM)
    assert error.shape == (*shape, 3)
    for where in np.ndindex(shape):
        for carriage in range(3):
            count = counts[(*where, carriage)] if carriage < axes else 0
            expected = position[(*where, carriage)] - count * STEP_MM[carriage]
            assert error[(*where, carriage)] == pytest.approx(expected, abs=1e-12)


def test_an_axis_that_is_turned_shows_its_motion_the_other_way_at_the_first_look() -> None:
    """10 mm gone, 3200 steps; the other way round this place is still 3200, and a millimetre back is 11."""
    axes = Axes(1, 1, 1, 1)
    axes.move(0, 3200)
    axes.controller.direction = (-1, 1, 1, 1)
    axes.move(0, 320)
    assert axes.mm == [11.0, 0.0, 0.0]


# ---- what a controller is told of its drives -----------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1, -1])
def test_lag_is_command_minus_measured_position_in_the_sense_of_the_counter(direction: int) -> None:
    """The command is led: 100 increments are told, 60 of them due by now, 55 made."""
    axes = Axes(1, direction, 1, 1)
    axes.controller.counts = (0, 100, 0, 0)
    axes.plant.commanded[1] = direction * 100
    axes.plant.command[1] = direction * 60.0
    axes.turn(1, direction * 55.0)
    axes.plant.lag[1] = direction * 5.0
    assert axes.position.lag == (0.0, 5.0, 0.0, 0.0)
    assert axes.position.encoder == (0, 55, 0, 0)
    axes.plant.lag[1] = -direction * 2.5
    axes.turn(1, direction * 7.5)
    assert axes.position.lag == (0.0, -2.5, 0.0, 0.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_lag_and_encoder_have_the_zero_of_the_counter(direction: int) -> None:
    """Command as led by now = encoder + lag, after slips have been forgotten, too."""
    axes = Axes(direction, 1, 1, 1)
    axes.move(0, 500)
    axes.turn(0, -direction * PERIOD)
    axes.plant.lag[0] = direction * PERIOD
    assert (axes.position.encoder[0], axes.position.lag[0]) == (468, 32.0)
    axes.set(0, 200)
    assert (axes.position.encoder[0], axes.position.lag[0]) == (200, 0.0)
    axes.move(0, 10)
    axes.turn(0, -direction * 4.0)
    axes.plant.lag[0] += direction * 4.0
    assert (axes.position.encoder[0], axes.position.lag[0]) == (206, 4.0)


def test_the_encoder_is_not_what_is_commanded() -> None:
    axes = Axes(1, -1)
    axes.controller.counts = (10, 10)
    axes.plant.commanded[:] = (10, -10)
    assert axes.position.encoder == (0, 0)
    axes.plant.rotor[:] = (9.6, -10.4)
    assert axes.position.encoder == (10, 10)
    assert all(type(n) is int for n in axes.position.encoder)


def test_power_and_fault_of_each_drive() -> None:
    axes = Axes(1, 1, 1, 1, 1)
    assert (axes.position.on, axes.position.fault) == ((False,) * 5, (False,) * 5)
    axes.plant.powered[:] = (True, False, True, True, True)
    axes.plant.fault[3] = True
    assert axes.position.on == (True, False, True, True, True)
    assert axes.position.fault == (False, False, False, True, False)
    assert all(type(n) is bool for n in (*axes.position.on, *axes.position.fault))
    assert all(type(n) is float for n in axes.position.lag)


# ---- anything that can happen, in any order ------------------------------------------------------------------------


EVENTS = st.lists(
    st.tuples(st.sampled_from(["move", "slip", "set"]), st.integers(0, 4), st.integers(-5000, 5000)), max_size=40
)


@given(direction=st.tuples(*[st.sampled_from([1, -1])] * 5), events=EVENTS)
def test_any_story_of_moves_slips_and_settings(direction: Sequence[int], events: list[tuple[str, int, int]]) -> None:
    axes = Axes(*direction)
    lost, forgotten, counts = [0] * 5, [0] * 5, [0] * 5
    for what, axis, n in events:
        if what == "move":
            axes.move(axis, n)
            counts[axis] += n
        elif what == "slip":
            axes.turn(axis, -direction[axis] * PERIOD * (n % 7 - 3))
            lost[axis] += PERIOD * (n % 7 - 3)
        else:
            axes.set(axis, n)
            forgotten[axis] += abs(lost[axis])
            counts[axis], lost[axis] = n, 0
        assert axes.lost == lost
        assert axes.forgotten == forgotten
        assert axes.position.counts.tolist() == counts
        assert axes.position.encoder == tuple(c - n for c, n in zip(counts, lost, strict=True))
        expected = [(counts[i] - lost[i]) * STEP_MM[i] for i in range(3)]
        np.testing.assert_allclose(axes.position.position_mm, expected, atol=1e-8)
        np.testing.assert_allclose(axes.position.error_mm, [-lost[i] * STEP_MM[i] for i in range(3)], atol=1e-8)
