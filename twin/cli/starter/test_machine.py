"""`python -m pytest`: the fixtures come with isel-twin."""

import pytest

from isel_twin.jobs.checks.asserts import assert_accepted, assert_ends_at, assert_no_step_lost, assert_outputs


def test_the_square_ends_where_it_began(watched):
    watched.play("jobs/$square")
    assert_accepted(watched)
    assert_no_step_lost(watched)
    assert_ends_at(watched, {"x": 20.0, "y": 20.0}, tolerance_mm=0.1)


@pytest.mark.twin(scenario="hood.toml")
def test_an_open_hood_takes_the_power(watched):
    watched.play("jobs/$square")
    assert_outputs(watched, power=0)
