"""The parts of a twin, and its random start.

TwinSpec  --- draw_up: files, plug-ins --->  Plans  --- seed, start --->  a twin, and another one ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Integral
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from isel_twin.controller import Controller, PluginError, UnknownNameError, controller_factory
from isel_twin.core.events import events_of
from isel_twin.core.spec import TwinSpec
from isel_twin.language import Language, language_factory
from isel_twin.machine import Machine, MachineError, with_overrides
from isel_twin.plant import Plant, Threshold
from isel_twin.wiring import ScenarioEvent

PLANTS = ("mujoco", "kinematic")


@dataclass(frozen=True, eq=False)
class Plans:
    """Parts shared by twins that differ only in seed, start and flash."""

    machine: Machine  # with all overrides
    events: tuple[ScenarioEvent, ...]
    # builds the controller from a flash image; None: the caller gave a controller
    new_controller: Callable[[bytes | None], Controller] | None
    new_language: Callable[[], Language | None] | None


@runtime_checkable
class HasModel(Protocol):
    """A plant whose model is slow to read."""

    def model_as_built(self) -> Any:
        """A fresh model of this plant, for `build_plant`."""


def draw_up(spec: TwinSpec, controller: Controller | None) -> tuple[Plans, Controller]:
    """Plans, and the first controller: the one given, else a new one.

    Raises ValueError (UnknownNameError, PluginError, MachineError, ScenarioError) with one clear line for anything
    wrong, and OSError for a scenario file that cannot be read.
    """
    new_controller, new_language = None, None
    as_built = spec.as_built
    if controller is None:
        settings = with_overrides(as_built, spec.overrides).controller
        new_controller = partial(_built, controller_factory(spec.controller), settings)
        try:
            controller = new_controller(spec.image)
        except (PluginError, UnknownNameError):
            raise
        except ValueError as error:
            raise MachineError(f"{as_built.file}: [controller]: {error}") from None
        new_language = language_factory(spec.controller)
    machine = spec.fitted(controller)
    events = spec.events if spec.scenario is None else events_of(spec.scenario, machine, controller)
    return Plans(machine, events, new_controller, new_language), controller


def _built(
    build: Callable[[bytes | None, Mapping[str, Any]], Controller], settings: Mapping[str, Any], flash: bytes | None
) -> Controller:
    return build(flash, settings)


def build_plant(
    plant: str,
    machine: Machine,
    thresholds: Sequence[Threshold],
    start_mm: NDArray[np.float64],
    axes: int,
    model: Any = None,
) -> Plant:
    """The plant of this name. model: from `HasModel`, of a plant of the same machine."""
    if plant == "kinematic":
        from isel_twin.plant.kinematic import KinematicPlant

        return KinematicPlant(machine, thresholds, start_mm, axes)
    from isel_twin.plant.mujoco import MujocoPlant

    return MujocoPlant(machine, thresholds, start_mm, axes, model)


def chances(seed: int) -> tuple[np.random.Generator, ...]:
    """What is left to chance in a twin, each with a generator of its own: power-on positions, trip points of switches,
    bounces, noise. Raises ValueError for what would leave it to this very run."""
    if not isinstance(seed, Integral) or seed < 0:
        raise ValueError(f"seed {seed!r}: must be a whole number from 0")
    return tuple(np.random.default_rng(one) for one in np.random.SeedSequence(seed).spawn(4))


def power_on_mm(
    machine: Machine, random: np.random.Generator, wanted_mm: Sequence[float] | None
) -> NDArray[np.float64]:
    """float64 [3], carriage positions at power-on: as wanted, else random. Raises ValueError for wanted positions
    beyond the hard stops."""
    if wanted_mm is None:
        return np.array([random.uniform(axis.power_on_low_mm, axis.power_on_high_mm) for axis in machine.axes])
    if len(wanted_mm) != len(machine.axes):
        raise ValueError(f"start_mm has {len(wanted_mm)} values; give one for each of X, Y and Z")
    for axis, position_mm in zip(machine.axes, wanted_mm, strict=True):
        low_mm, high_mm = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        if not low_mm <= position_mm <= high_mm:
            raise ValueError(f"start_mm: {axis.name} = {position_mm}; it must lie from {low_mm:g} to {high_mm:g} mm")
    return np.array(wanted_mm, dtype=np.float64)
