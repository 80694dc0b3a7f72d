"""A model is compiled once for all machines of which the same would come out, and no two of them share it."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from isel_twin.machine import Fixture, load_machine, with_overrides
from isel_twin.plant import model as module
from isel_twin.plant.model import load_model

MACHINE = load_machine("4030")
SIZES = ("body_mass", "body_subtreemass", "dof_frictionloss", "dof_damping", "dof_invweight0", "jnt_stiffness")


def compiled() -> int:
    return module.bare.cache_info().misses


def fresh(machine: Any, **how: bool) -> mujoco.MjModel:
    module.bare.cache_clear()
    return load_model(machine, **how)


def same(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    return bytes(memoryview(saved(one))) == bytes(memoryview(saved(other)))


def saved(model: mujoco.MjModel) -> np.ndarray:
    buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer


@pytest.mark.parametrize(
    "overrides",
    [
        {"axes.x.guide_friction": 55.0},
        {"payload.mass": 6.5},
        {"structure.flex_x.stiffness": 2.0},
        {"structure.flex_y.damping_ratio": 0.1, "payload.mass": 1.0, "axes.z.guide_friction": 3.0},
    ],
    ids=lambda overrides: next(iter(overrides)),
)
def test_what_a_machine_wears_is_put_on_a_copy(overrides: dict[str, float]) -> None:
    other = with_overrides(MACHINE, overrides)
    expected = fresh(other)
    plain = fresh(MACHINE)
    before = compiled()
    assert same(load_model(other), expected)
    assert same(load_model(MACHINE), plain)
    assert compiled() == before


@pytest.mark.parametrize(
    "overrides",
    [{"masses.portal": 17.0}, {"axes.y.travel": 250.0}, {"timing.mujoco_step": 0.25}, {"axes.x.stop_margin": 9.0}],
    ids=lambda overrides: next(iter(overrides)),
)
def test_another_body_is_compiled_anew(overrides: dict[str, float]) -> None:
    other = with_overrides(MACHINE, overrides)
    expected = fresh(other)
    load_model(MACHINE)
    assert same(load_model(other), expected)
    assert not same(load_model(MACHINE), expected)


def test_what_stands_on_the_table_a_probe_and_who_looks_are_others() -> None:
    jaw = Fixture("jaw", "box", (10.0, 10.0, 10.0), (100.0, 100.0, 0.0))
    clamped = replace(MACHINE, fixtures=(jaw,))
    moved = replace(MACHINE, fixtures=(replace(jaw, at_mm=(90.0, 100.0, 0.0)),))
    probed, longer = (with_overrides(MACHINE, {"probe.enabled": True, "probe.reach": reach}) for reach in (40.0, 50.0))
    calls: list[tuple[Any, dict[str, bool]]] = [
        (MACHINE, {}), (MACHINE, {"visual": False}), (clamped, {}), (moved, {}), (clamped, {"watched": True}),
        (probed, {}), (longer, {}),
    ]  # fmt: skip
    models = [load_model(machine, **how) for machine, how in calls]
    expected = [fresh(machine, **how) for machine, how in calls]
    assert all(same(one, other) for one, other in zip(models, expected, strict=True))
    assert len({bytes(memoryview(saved(model))) for model in models}) == len(models)


def test_what_is_done_to_one_is_not_done_to_the_next() -> None:
    load_model(MACHINE).body_mass[:] = 0.0
    assert load_model(MACHINE).body_mass.max() > 0.0


def test_a_file_that_was_changed_is_read_again(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    shutil.copytree(MACHINE.folder, folder)
    machine = load_machine(folder)
    before = load_model(machine)
    text = machine.model_file.read_text().replace("</worldbody>", '<site name="new"/></worldbody>')
    machine.model_file.write_text(text)
    os.utime(machine.model_file, ns=(1, 1))
    assert load_model(machine).nsite == before.nsite + 1
