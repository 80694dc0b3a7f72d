"""Sine and cosine at once, against the library, which is right to the last digit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drives.axis import rigs
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.thorough import drawn

LAST_DIGIT = 2.0**-52
FAR_RAD = 1e6  # from here on the library is used


def sine_and_cosine(angle_rad: float) -> tuple[float, float]:
    found = np.empty(2)
    rigs.sines(angle_rad, found)
    sine, cosine = found.tolist()
    return sine, cosine


@settings(max_examples=drawn(2000))
@given(
    st.floats(-FAR_RAD, FAR_RAD)
    | st.floats(-10.0, 10.0)
    | st.integers(-640_000, 640_000).map(lambda n: n * math.pi / 2)
)
def test_both_are_right_to_the_last_digit(angle_rad: float) -> None:
    sine, cosine = sine_and_cosine(angle_rad)
    assert abs(sine - math.sin(angle_rad)) <= LAST_DIGIT
    assert abs(cosine - math.cos(angle_rad)) <= LAST_DIGIT
    assert sine_and_cosine(-angle_rad) == (-sine, cosine)


@pytest.mark.parametrize(("angle_rad", "expected"), [(0.0, (0.0, 1.0)), (1e300, (math.sin(1e300), math.cos(1e300)))])
def test_nothing_and_everything(angle_rad: float, expected: tuple[float, float]) -> None:
    assert sine_and_cosine(angle_rad) == expected


def test_what_is_no_number_stays_none() -> None:
    assert all(math.isnan(value) for value in sine_and_cosine(math.nan))
