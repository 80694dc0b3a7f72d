"""What is worked out once from parameters is worked out anew when one of those changes."""

from __future__ import annotations

from isel_twin.firmware.bwo900.numbers import Axis
from isel_twin.firmware.bwo900.parameters import Parameters, descriptor, of_axis
from isel_twin.firmware.bwo900.realtime.axes import Axes


def test_a_parameter_has_another_place_when_a_definition_changes() -> None:
    """q102 and q103: where user block 1 begins and how long it is; q111: the physical axis of Y."""
    p = Parameters()
    p.write(5, 1.5)
    before = [p.address("P", number) for number in (5, 7_000, 12_200)]
    assert before == [10_005, 15_000, 2_200]
    for q, value in ((102, 11_000.0), (103, 4_000.0), (111, descriptor("Y", 3))):
        p.write(q, value, "q")
    assert [p.address("P", number) for number in (5, 7_000, 12_200)] == [11_005, 15_000, 2_400]
    assert not p.loaded(5)
    p.write(103, None, "q")
    assert p.address("P", 7_000) == 11_000, "a block without a size"


def test_limits_follow_a_changed_parameter_and_no_other() -> None:
    p = Parameters()
    axes = Axes(p, {})
    limits = axes.limits()
    p.write(of_axis(0, Axis.SPEED), 3_000.0)
    changed = axes.limits()
    assert (changed.speed[0], changed.speed[1]) == (50.0, limits.speed[1])
    p.write(of_axis(0, Axis.SPEED), 3_000.0)
    assert axes.limits() is changed


def test_counts_at_one_instant_follow_the_reference_point() -> None:
    p = Parameters()
    p.write(of_axis(1, Axis.REFERENCE_MM), 5.0)
    axes = Axes(p, {})
    assert axes.counts == (0, 0, 0)
    axes.place(1)
    assert axes.counts == (0, 5_000, 0)
