"""What a twin refuses, and that a refusal changes nothing."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import pytest

from isel_twin import Twin


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps], ids=lambda call: call.__name__)
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_twin_cannot_be_copied(duplicate: Any, plant: str) -> None:
    """A copy would share the compiled physics with the original, and both would be wrong."""
    twin = Twin(plant=plant)
    with pytest.raises(TypeError, match="a twin cannot be copied or pickled") as error:
        duplicate(twin)
    assert "\n" not in str(error.value)
    with pytest.raises(TypeError, match="a twin cannot be copied"):
        copy.deepcopy({"twin": [twin]})
    assert twin.query("@07") == "0"


@pytest.mark.parametrize("seed", [None, -1, 1.5, "a"], ids=repr)
def test_a_seed_that_is_no_whole_number_is_refused(seed: Any) -> None:
    """None would leave the power-on position to this very run."""
    with pytest.raises(ValueError, match=r"seed .*: must be a whole number from 0"):
        Twin(plant="kinematic", seed=seed)


@pytest.mark.parametrize("data", ["@07\r", 7, None, [64, 48]], ids=repr)
def test_what_is_written_must_be_bytes(data: Any) -> None:
    twin = Twin(plant="kinematic")
    with pytest.raises(TypeError, match="bytes"):
        twin.write(data)
    assert twin.idle
    assert twin.query("@07") == "0"


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_anything_that_holds_bytes_can_be_written(kind: Any) -> None:
    twin = Twin(plant="kinematic")
    twin.write(kind(b"@07\r"))
    assert twin.run_until_idle()
    assert twin.read() == b"0"
