"""What a twin is put together from, and what of it is drawn when it is switched on.

TwinSpec  --- draw_up: files, plug-ins --->  Plans  --- seed, start --->  a twin, and another one ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from isel_twin.controller import (
    Controller,
    HasKeys,
    NamesOutputs,
    PluginError,
    UnknownNameError,
    controller_factory,
    offers,
)
from isel_twin.core.spec import TwinSpec
from isel_twin.language import Language, language_factory
from isel_twin.machine import Machine, MachineError, with_overrides
from isel_twin.plant import Plant, Threshold
from isel_twin.wiring import ScenarioEvent, load_scenario, outputs, settable

PLANTS = ("mujoco", "kinematic")


@dataclass(frozen=True, eq=False)
class Plans:
    """What twins that differ in seed, start and flash alone have in common."""

    machine: Machine
    """With all overrides."""
    events: tuple[ScenarioEvent, ...]
    new_controller: Callable[[bytes | None], Controller] | None
    """Builds the controller, given a flash image; None: it was handed in, and there is no other."""
    new_language: Callable[[], Language | None] | None


@runtime_checkable
class HasModel(Protocol):
    """A plant whose model takes time to read."""

    def model_as_built(self) -> Any:
        """Another one, as that of this plant was before anything was changed in it, for `build_plant`."""


def draw_up(spec: TwinSpec, controller: Controller | None) -> tuple[Plans, Controller]:
    """Plans, and the first controller: the one that was handed in, or one that has been built.

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
    # The controller's own wishes come first: whoever builds the twin has the last word.
    machine = with_overrides(with_overrides(as_built, controller.machine_overrides()), spec.overrides)
    return Plans(machine, _events(spec, machine, controller), new_controller, new_language), controller


def _events(spec: TwinSpec, machine: Machine, controller: Controller) -> tuple[ScenarioEvent, ...]:
    if spec.scenario is None:
        return spec.events
    if spec.events:
        raise ValueError(f"{spec.scenario}: there are events, too; allowed: one of the two")
    own = controller.output_names if offers(controller, NamesOutputs) else ()
    keys = controller.keys if offers(controller, HasKeys) else {}
    switches = [switch.name for switch in machine.switches]
    return load_scenario(spec.scenario, settable(machine), switches, (*outputs(machine), *own), keys)


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
    """The plant of that name; model: of `HasModel`, of a plant of this machine."""
    if plant == "kinematic":
        from isel_twin.plant.kinematic import KinematicPlant

        return KinematicPlant(machine, thresholds, start_mm, axes)
    from isel_twin.plant.mujoco import MujocoPlant

    return MujocoPlant(machine, thresholds, start_mm, axes, model)


def power_on_mm(
    machine: Machine, random: np.random.Generator, wanted_mm: Sequence[float] | None
) -> NDArray[np.float64]:
    """float64 [3], where the carriages stand when the mains is switched on: as wanted, or where they happen to be.

    Raises ValueError unless the wanted positions lie between the hard stops.
    """
    if wanted_mm is None:
        return np.array([random.uniform(axis.power_on_low_mm, axis.power_on_high_mm) for axis in machine.axes])
    if len(wanted_mm) != len(machine.axes):
        raise ValueError(f"start_mm has {len(wanted_mm)} values; give one for each of X, Y and Z")
    for axis, position_mm in zip(machine.axes, wanted_mm, strict=True):
        low_mm, high_mm = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        if not low_mm <= position_mm <= high_mm:
            raise ValueError(f"start_mm: {axis.name} = {position_mm}; it must lie from {low_mm:g} to {high_mm:g} mm")
    return np.array(wanted_mm, dtype=np.float64)
