"""The machine's MuJoCo model: its MJCF file with what machine.toml says about it.

The MJCF gives the tree of bodies; masses, travel, guide friction, payload, fixture and structural modes are set when
the model is loaded, so that overrides work. Parts of the MJCF that are only for use without the twin are left out, as
the drives are simulated outside the model: armature, friction and damping of rotor and screw, actuators, sensors,
keyframes (plant/12).

    structure   k as stated,  c = 2 zeta sqrt(k m),  f = sqrt(k / m) / 2 pi       m: what the mode's joint carries

so that a static push deflects as the springs between there and the ground say, and ringing follows (plant/2; the damper
is that of the machine without payload). A force F at a place, tool or table, loads the joints by tau = J^T F, J: motion
of that place by the joints.

Positions are what a gauge between tool and table would show: axis joint plus structural joint, plus the errors of
squareness (decision plant/5).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.errors import one_line
from isel_twin.machine import Machine, MachineError
from isel_twin.plant import PLACES
from isel_twin.plant.clamped import EXACT_M, PREFIX, TIP, lay, let_meet, may_meet, name_all, put_probe
from isel_twin.plant.touch import targets

MODELS = 16  # the last that were compiled, some 100 kB each


def load_model(machine: Machine, *, visual: bool = True, watched: bool = False) -> mujoco.MjModel:
    """The model with what machine.toml says about it. visual: keep geoms that are only for display; a step takes a
    third longer. watched: with a sensor for each two shapes that must not meet (clamped.py).

    It is compiled once for machines that differ only in masses, guide friction, payload and structure (plant/23).

    Raises MachineError if model or fixture cannot be read, a joint or body that the machine names is missing, or a
    joint does not have exactly one coordinate.
    """
    return load(machine, visual=visual, watched=watched)[0]


def load(machine: Machine, *, visual: bool, watched: bool) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """As `load_model`, with data for it in some state."""
    known = bare(asked_of(machine, visual=visual, watched=watched))
    model = copy.copy(known.model)
    data = mujoco.MjData(model)
    dress(known, machine, model, data)
    return model, data


@dataclass(frozen=True)
class Asked:
    """A model to compile; equal to another if the same would come out."""

    bare: Hashable
    visual: bool
    watched: bool
    machine: Machine = field(compare=False)


def asked_of(machine: Machine, *, visual: bool, watched: bool) -> Asked:
    return Asked(_bare(machine), visual, watched, machine)


def _bare(machine: Machine) -> Hashable:
    """All of a machine that `compiled` looks at, and when its files were written."""
    files = [machine.model_file, machine.fixture_file, *(fixture.file for fixture in machine.fixtures)]
    return tuple(_written(file) for file in files if file is not None), repr(machine.fixtures), _tree(machine)


def _tree(machine: Machine) -> Hashable:
    """The same without the files."""
    probe = machine.probe
    return (
        (probe.ball_mm, probe.reach_mm) if probe is not None and probe.enabled else None,
        tuple(machine.masses_kg),
        tuple((axis.name, axis.stop_margin_mm, axis.travel_mm) for axis in machine.axes),
        tuple(mode.joint for mode in machine.structure),
        machine.imperfections.structure,
        machine.timing.mujoco_step_ns,
    )


def _written(file: Path) -> Hashable:
    try:
        stat = file.stat()
    except OSError:  # whoever reads it says so
        return file, None, None
    return file, stat.st_mtime_ns, stat.st_size


def compiled(asked: Asked) -> mujoco.MjModel:
    """The model with the masses of its file, without springs of the structure and payload. Errors: `load_model`."""
    machine, visual, watched = asked.machine, asked.visual, asked.watched
    try:
        spec = mujoco.MjSpec.from_file(str(machine.model_file))
    except ValueError as error:
        raise MachineError(f"{machine.model_file}: {one_line(str(error))}") from None
    _need(machine, spec, [axis.name for axis in machine.axes], "joint")
    _need(machine, spec, [mode.joint for mode in machine.structure], "joint")
    _need(machine, spec, machine.masses_kg, "body")
    _need(machine, spec, PLACES.values(), "site")
    for extra in (*spec.keys, *spec.sensors, *spec.actuators):
        spec.delete(extra)
    if not machine.imperfections.structure:
        for mode in machine.structure:
            spec.delete(spec.joint(mode.joint))
    if machine.is_clamped:
        name_all(spec)
    if machine.fixture_file is not None:
        try:
            fixture = mujoco.MjSpec.from_file(str(machine.fixture_file))
            spec.attach(fixture, prefix=PREFIX, site=spec.site("table_top"))
            for sensor in list(spec.sensors):
                spec.delete(sensor)
        except ValueError as error:
            raise MachineError(f"{machine.fixture_file}: {one_line(str(error))}") from None
    if machine.probe is not None and machine.probe.enabled:
        put_probe(spec, machine.probe)
    if machine.fixtures:
        lay(spec, machine.fixtures)
    spec.option.timestep = machine.timing.mujoco_step_ns * 1e-9
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for axis in machine.axes:
        joint = spec.joint(axis.name)
        joint.range = np.array([-axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm]) * 1e-3
        joint.armature = 0.0
        joint.damping = np.zeros_like(joint.damping)
    try:
        if machine.is_clamped and (watched or not visual):
            name_all(spec, PREFIX)
            let_meet(machine, spec, watched=watched)
            spec.option.ccd_tolerance = EXACT_M
        if not visual:
            for geom in list(spec.geoms):
                if geom.contype == 0 and geom.conaffinity == 0:
                    spec.delete(geom)
        model = spec.compile()
        if watched and not machine.is_clamped and may_meet(model):
            name_all(spec)
            let_meet(machine, spec, watched=True)
            model = spec.compile()
    except MachineError:
        raise
    except ValueError as error:
        raise MachineError(f"{machine.model_file}: {one_line(str(error))}") from None
    if model.nq != model.nv:
        raise MachineError(f"{machine.file}: model, fixture: a ball or free joint; allowed: slide and hinge joints")
    return model


def same_model(machine: Machine, other: Machine) -> bool:
    """Whether the models of two machines differ in nothing but what `dress` puts on them."""
    one, two = ((each.model_file, each.fixture_file, each.fixtures, _tree(each)) for each in (machine, other))
    return one == two


@dataclass(frozen=True, eq=False)
class Bare:
    """A model as `compiled` makes it, and where the numbers of a machine have their places in it."""

    model: mujoco.MjModel
    means: tuple[float, float]  # inertia of the joints, mass of the bodies
    stated: bool  # so its file says; else they are computed
    axes: NDArray[np.int64]  # [3], joint coordinates of X, Y and Z
    masses_kg: NDArray[np.float64]  # of all bodies
    bodies: NDArray[np.int64]  # [b], in the order of Machine.masses_kg
    inertia: NDArray[np.float64]  # [b, 3], kg m2
    modes: NDArray[np.int64]  # joints of the structure, in the order of Machine.structure
    dampers: NDArray[np.int64]  # joint coordinates of them
    carriers: NDArray[np.int64]  # bodies on them
    table: int  # body


@lru_cache(MODELS)
def bare(asked: Asked) -> Bare:
    """Errors: `load_model`."""
    model, machine = compiled(asked), asked.machine
    bodies = np.array([model.body(name).id for name in machine.masses_kg], np.int64)
    structure = machine.structure if machine.imperfections.structure else ()
    modes = np.array([model.joint(mode.joint).id for mode in structure], np.int64)
    means = model.stat.meaninertia, model.stat.meanmass
    return Bare(
        model,
        means=means,
        stated=_means(model) != means,
        axes=np.array([model.joint(axis.name).dofadr[0] for axis in machine.axes]),
        masses_kg=model.body_mass.copy(),
        bodies=bodies,
        inertia=model.body_inertia[bodies],
        modes=modes,
        dampers=model.jnt_dofadr[modes],
        carriers=model.jnt_bodyid[modes],
        table=model.body("table").id,
    )


def dress(
    known: Bare, machine: Machine, model: mujoco.MjModel, data: mujoco.MjData, worn: Machine | None = None
) -> None:
    """Put guide friction, masses, springs of the structure and payload of a machine on a model as `compiled` left it,
    or in place of those of another machine, which has the `same_model`. data: of the model, for scratch. worn: the
    other one, so that what is the same may stay."""
    model.dof_frictionloss[known.axes] = [axis.guide_friction_n for axis in machine.axes]
    bare = worn is None or machine.masses_kg is not worn.masses_kg or machine.structure is not worn.structure
    if bare:
        _put_on(known, machine, model, data)
    if machine.payload_kg > 0.0 or not bare:  # at the table's centre of gravity: it does not turn, so any place does
        model.body_mass[known.table] = machine.masses_kg.get("table", known.masses_kg[known.table]) + machine.payload_kg
        mujoco.mj_setConst(model, data)


def _put_on(known: Bare, machine: Machine, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Put on masses and springs, without payload."""
    masses_kg, bodies = list(machine.masses_kg.values()), known.bodies
    model.body_mass[:] = known.masses_kg
    model.body_mass[bodies] = masses_kg
    model.body_inertia[bodies] = known.inertia * (masses_kg / known.masses_kg[bodies])[:, None]
    model.stat.meaninertia, model.stat.meanmass = known.means
    mujoco.mj_setConst(model, data)
    if not known.stated:  # MuJoCo computes them when it compiles, and its solver asks for one
        model.stat.meaninertia, model.stat.meanmass = _means(model)
    if len(known.modes):
        stiffness = np.array([mode.stiffness_n_per_m for mode in machine.structure])
        twice = np.array([2.0 * mode.damping_ratio for mode in machine.structure])
        model.jnt_stiffness[known.modes] = stiffness
        model.dof_damping[known.dampers] = twice * np.sqrt(stiffness * model.body_subtreemass[known.carriers])


def _means(model: mujoco.MjModel) -> tuple[float, float]:
    """Mean inertia of the joints and mean mass of the bodies, as MuJoCo's compiler computes them."""
    return sum(model.dof_M0.tolist()) / model.nv, sum(model.body_mass.tolist()) / (model.nbody - 1)


def found_targets(machine: Machine, model: mujoco.MjModel, scratch: mujoco.MjData | None = None) -> NDArray[np.void]:
    """What the machine's feeler can touch (touch.targets)."""
    down = _ways(machine, model, _jacobian(model, scratch))[2]
    data = blank(model, scratch)
    mujoco.mj_kinematics(model, data)
    to_table_m = down @ (data.site(PLACES["table"]).xpos - data.site(PLACES["tool"]).xpos)
    tips = [geom for geom in range(model.ngeom) if model.geom(geom).name == TIP]
    radius_m = float(model.geom_size[tips[0], 0]) if tips else 0.0
    return targets(machine, 1e3 * float(to_table_m), 1e3 * radius_m)


def tool_motion(machine: Machine, model: mujoco.MjModel) -> NDArray[np.float64]:
    """float64 [3, nv]: what each joint contributes to X, Y and Z between tool and table."""
    shape = np.zeros((len(CARRIAGES), model.nv))
    for number, name in enumerate(CARRIAGES):
        shape[number, model.joint(name).dofadr[0]] = 1.0
    if machine.imperfections.structure:
        for mode in machine.structure:
            shape[CARRIAGES.index(mode.axis), model.joint(mode.joint).dofadr[0]] = 1.0
    if machine.imperfections.squareness:
        error = machine.squareness
        shape = np.array([[1.0, error.xy, error.xz], [0.0, 1.0, error.yz], [0.0, 0.0, 1.0]]) @ shape
    return shape


def reach(
    machine: Machine, model: mujoco.MjModel, scratch: mujoco.MjData | None = None
) -> dict[str, NDArray[np.float64]]:
    """By place, float64 [3, nv]: what each joint contributes to X, Y and Z by moving tool or table; their sum is
    `tool_motion` without squareness. Its transpose turns forces on that place into those on the joints.

    Raises MachineError for a structural joint that does not move the tool over the table along its axis, in the
    direction of rising positions.
    """
    jacobian = _jacobian(model, scratch)
    ways = _ways(machine, model, jacobian)
    places = {"tool": ways @ jacobian["tool"], "table": -ways @ jacobian["table"]}
    for mode in machine.structure if machine.imperfections.structure else ():
        moves = (places["tool"] + places["table"])[:, model.joint(mode.joint).dofadr[0]]
        if not np.allclose(moves, np.array(CARRIAGES) == mode.axis, atol=1e-6):
            way = ", ".join(f"{part:.3g}" for part in moves)
            raise MachineError(
                f"{machine.file}: structure.{mode.joint}: its joint moves the tool over the table by ({way}) along X, "
                f"Y, Z; allowed: by 1 along {mode.axis}"
            )
    return places


def left_of_x(machine: Machine, model: mujoco.MjModel, scratch: mujoco.MjData | None = None) -> float:
    """+1 if Y is to the left of X, seen along the tool, -1 if -Y is."""
    return math.copysign(1.0, -float(np.linalg.det(_ways(machine, model, _jacobian(model, scratch)))))


def blank(model: mujoco.MjModel, scratch: mujoco.MjData | None) -> mujoco.MjData:
    """The scratch data reset (ten times faster than new data), or new data if there is none."""
    if scratch is None:
        return mujoco.MjData(model)
    mujoco.mj_resetData(model, scratch)
    return scratch


def _jacobian(model: mujoco.MjModel, scratch: mujoco.MjData | None) -> dict[str, NDArray[np.float64]]:
    """By place, float64 [3, nv]: its motion in the world by each joint."""
    data = blank(model, scratch)
    mujoco.mj_forward(model, data)
    jacobian = {place: np.zeros((3, model.nv)) for place in PLACES}
    for place, site in PLACES.items():
        mujoco.mj_jacSite(model, data, jacobian[place], None, model.site(site).id)
    return jacobian


def _ways(machine: Machine, model: mujoco.MjModel, jacobian: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """float64 [3, 3], directions of X, Y and Z in the world: how they move the tool, seen from the table."""
    between = jacobian["tool"] - jacobian["table"]
    return np.array([between[:, model.joint(axis.name).dofadr[0]] for axis in machine.axes])


def mode_hz(machine: Machine, model: mujoco.MjModel) -> dict[str, float]:
    """Frequency of each structural mode in Hz, by its joint."""
    found = {}
    for mode in machine.structure:
        mass_kg = model.body_subtreemass[model.jnt_bodyid[model.joint(mode.joint).id]]
        found[mode.joint] = math.sqrt(mode.stiffness_n_per_m / mass_kg) / (2.0 * math.pi)
    return found


def _need(machine: Machine, spec: mujoco.MjSpec, names: Iterable[str], kind: str) -> None:
    known = [item.name for item in {"joint": spec.joints, "body": spec.bodies, "site": spec.sites}[kind]]
    for name in names:
        if name not in known:
            raise MachineError(f"{machine.model_file}: no {kind} {name!r}; allowed: {', '.join(known)}")
