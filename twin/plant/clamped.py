"""What is clamped on the table, in the machine's model; and who meets whom.

Goal: a fixture is a shape that stands where the file says, is seen, is felt, and is told of when something strikes it.

    tool chain                                        standing
    bodies between the tool and the root,             fixtures, and the table
    but for those that carry the table, too
    |- a body with shapes NAME_contact: these         each a shape of its own, named as in its file
    `- any other: what is to be seen of it, by the body's name

So says plant/21. Pairs of the two that can come within MOST_CLEARANCE_MM of each other, as the joints go (reach.py),
are looked at; all else of the machine stays as it is. Pairs that may touch are not looked at, and the cutter goes
through stock (Fixture).

MuJoCo itself tells of contacts: each pair has a sensor that counts them at every one of its steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.errors import one_line
from isel_twin.base.parameters import hint
from isel_twin.machine import Machine, MachineError, Probe
from isel_twin.machine.fixture import CUTTER, Fixture
from isel_twin.plant import MOST_CLEARANCE_MM, PLACES
from isel_twin.plant.reach import can_meet, carried, collide, joint_bounds

EXACT_M = (
    1e-9  # of MuJoCo's distances; its own 1e-6 leaves some nanometres, in which a machine that creeps takes a step
)
PREFIX = "fixture/"  # of the names of what is clamped on the table, in the model
_NAMELESS = "#"  # in the names of shapes that had none
_SHAPE = "_contact"  # ends the names of a machine's shapes that are made for contacts
TIP = "tool_contact"  # the cutter
STYLUS = "stylus_contact"  # what is between the ball of a probe and the spindle
_NAMES = {"tool": CUTTER}  # what people call them, where the model says it otherwise
_FELT, _CUTS = 1 << 4, 1 << 3  # bits of contacts: a machine's shape, the cutter
_HULL_GROUP = 4  # of what is only drawn: the hood
_GREY = (0.45, 0.50, 0.55, 1.0)
_WEDGES = 16  # of which a ring is made
_RUBY = (0.75, 0.05, 0.15, 1.0)
_WOOD = (0.76, 0.62, 0.42, 1.0)


class Pair(NamedTuple):
    """Two shapes that must not meet: their numbers in the model, and what people call them."""

    moving: int
    standing: int
    names: tuple[str, str]


def pairs(model: mujoco.MjModel) -> tuple[Pair, ...]:
    """Those of a model with sensors for them, in their order."""
    found = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_CONTACT)
    geoms = [(int(model.sensor_objid[i]), int(model.sensor_refid[i])) for i in found]
    return tuple(Pair(a, b, (name_of(model, a), name_of(model, b))) for a, b in geoms)


def name_of(model: mujoco.MjModel, geom: int) -> str:
    """What people call a shape."""
    name = model.geom(geom).name
    if name.endswith(_SHAPE):
        return _NAMES.get(stem := name.removesuffix(_SHAPE), stem)
    if name.startswith(PREFIX) and (stem := of_fixture(name).removeprefix(PREFIX)):
        return stem
    return str(model.body(model.geom_bodyid[geom]).name).removeprefix(PREFIX) or "fixture"


def of_fixture(name: str) -> str:
    """Name of the fixture of which a geom is a part; that of a geom without a name is nothing but PREFIX."""
    return name.partition(_NAMELESS)[0]


def put_probe(spec: mujoco.MjSpec, probe: Probe) -> None:
    """Put a touch probe in place of the cutter. The ball is to be seen, and felt by touch.py; of the stylus the upper
    half collides, the lower one gives way with the ball."""
    site = spec.site(PLACES["tool"])
    tool = site.parent
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    down = data.body(tool.name).xmat.reshape(3, 3).T @ ways_of(model, data)[2]
    like = next((geom for geom in tool.geoms if geom.name == TIP), None)
    ball_m, point = 0.5e-3 * probe.ball_mm, np.array(site.pos)
    middle = point + (1e-3 * probe.reach_mm - ball_m) * down
    top = point if like is None else point - 2.0 * like.size[1] * down
    made = {}
    if like is not None:
        made = {key: getattr(like, key) for key in ("contype", "conaffinity", "priority", "solref", "solimp")}
        made = {key: np.copy(value) if isinstance(value, np.ndarray) else value for key, value in made.items()}
        for geom in [geom for geom in tool.geoms if geom.name in (TIP, CUTTER)]:
            spec.delete(geom)
    seen = {"mass": 0.0, "contype": 0, "conaffinity": 0, "group": 1}
    size = [0.3 * ball_m, 0.0, 0.0]
    cylinder, sphere = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE
    tool.add_geom(name="stylus", type=cylinder, fromto=[*top, *middle], size=size, rgba=_GREY, **seen)
    tool.add_geom(name="ball", type=sphere, pos=middle, size=[ball_m, 0.0, 0.0], rgba=_RUBY, **seen)
    tool.add_geom(
        name=STYLUS, type=cylinder, fromto=[*top, *(0.5 * (top + middle))], size=size, **{**seen, "group": 3, **made}
    )


def may_meet(model: mujoco.MjModel) -> bool:
    """Whether shapes of a model without fixtures can meet, the tool's and the table's."""
    felt = [(a, b) for a in range(model.ngeom) for b in range(a) if collide(model, a, b)]
    if not felt or (model.jnt_type != mujoco.mjtJoint.mjJNT_SLIDE).any():
        return bool(felt)
    data, bounds = mujoco.MjData(model), joint_bounds(model)
    data.qpos[:] = bounds.mean(axis=0)
    mujoco.mj_kinematics(model, data)
    return any(can_meet(model, data, bounds, a, b) for a, b in felt)


def lay(spec: mujoco.MjSpec, fixtures: Sequence[Fixture]) -> None:
    """Put the shapes on the table of a machine's spec. Raises MachineError for a mesh that cannot be read."""
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    top, tool = data.site(PLACES["table"]), data.site(PLACES["tool"])
    table = spec.site(PLACES["table"]).parent
    body = data.body(table.name)
    ways = ways_of(model, data)
    frame = np.column_stack((ways[0], np.cross(-ways[2], ways[0]), -ways[2]))  # X, to its left, up
    left = 1.0 if frame[:, 1] @ ways[1] > 0.0 else -1.0
    to_body = body.xmat.reshape(3, 3).T
    for fixture in fixtures:
        x_m, y_m, up_m = 1e-3 * np.array(fixture.at_mm)
        below = tool.xpos + x_m * ways[0] + y_m * ways[1]
        foot = below + ways[2] * (ways[2] @ (top.xpos - below)) - up_m * ways[2]
        turn = left * math.radians(fixture.turn_deg)
        turned = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
        for part in range(_WEDGES if fixture.shape == "ring" else 1):
            name = f"{PREFIX}{fixture.name}" + (f"{_NAMELESS}{part}" if part else "")
            geom = table.add_geom(name=name, mass=0.0, group=1, rgba=_WOOD if fixture.stock else _GREY)
            height_m, beside_m = _shape(spec, geom, fixture)
            angle = 2.0 * math.pi * part / _WEDGES
            round_it = np.array(
                [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
            )
            ahead = frame @ turned @ round_it
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, (to_body @ ahead).ravel())
            geom.quat = quaternion
            geom.pos = to_body @ (foot + beside_m * ahead[:, 0] - 0.5 * height_m * ways[2] - body.xpos)
            geom.contype, geom.conaffinity = 0, _FELT  # and what else can feel it: `let_meet`


def _shape(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, fixture: Fixture) -> tuple[float, float]:
    """Give a geom its shape, or that of a wedge of a ring; returns how far its middle is above its foot, times two, and
    beside the fixture's middle, m."""
    if fixture.file is not None:
        _add_mesh(spec, geom.name, fixture)
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, geom.name
        return 0.0, 0.0
    beside_m = 0.0
    if fixture.shape == "box":
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, 0.5e-3 * np.array(fixture.size_mm)
    elif fixture.shape == "ring":  # its inner sides touch the bore: nothing that fits in there meets them
        outer_mm, inner_mm, height_mm = fixture.size_mm
        wide_m = 0.5e-3 * outer_mm * math.tan(math.pi / _WEDGES)
        geom.type = mujoco.mjtGeom.mjGEOM_BOX
        geom.size = [0.25e-3 * (outer_mm - inner_mm), wide_m, 0.5e-3 * height_mm]
        beside_m = 0.25e-3 * (outer_mm + inner_mm)
    else:
        diameter_mm, height_mm = fixture.size_mm
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [0.5e-3 * diameter_mm, 0.5e-3 * height_mm, 0.0]
    return 1e-3 * fixture.size_mm[-1], beside_m


def _add_mesh(spec: mujoco.MjSpec, name: str, fixture: Fixture) -> None:
    file = str(Path(str(fixture.file)).resolve())
    alone = mujoco.MjSpec()
    for each in (alone, spec):
        each.add_mesh(name=name, file=file, scale=[1e-3, 1e-3, 1e-3])
    alone.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
    try:
        alone.compile()
    except ValueError as error:
        raise MachineError(f"{fixture.shown}.file: {file}: {one_line(str(error))}") from None


def ways_of(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """float64 [3, 3], which way X, Y and Z point in the world: where they move the tool, seen from the table."""
    bodies = [model.site(PLACES[place]).bodyid[0] for place in ("tool", "table")]
    ways = np.zeros((len(CARRIAGES), 3))
    for number, name in enumerate(CARRIAGES):
        joint = model.joint(name)
        carries = [carried(model, int(model.jnt_bodyid[joint.id]), int(body)) for body in bodies]
        ways[number] = (carries[0] - carries[1]) * data.xaxis[joint.id]
    return ways


def name_all(spec: mujoco.MjSpec, prefix: str = "") -> None:
    """Give shapes without a name one that nobody is told."""
    for number, geom in enumerate(spec.geoms):
        if not geom.name:
            geom.name = f"{prefix}{_NAMELESS}{number}"


def let_meet(machine: Machine, spec: mujoco.MjSpec, *, watched: bool) -> None:
    """Let the shapes that can meet what stands on the table feel it; watched: and give each pair that must not meet a
    sensor.

    All shapes have names. Raises MachineError for names of a file that nothing has.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    slides = bool((model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE).all())
    bounds = joint_bounds(model) if slides else np.zeros((2, model.nv))
    if slides:
        data.qpos[:] = bounds.mean(axis=0)
    mujoco.mj_kinematics(model, data)
    yields = [PREFIX + one.name for one in machine.fixtures if one.stock or one.plate]  # to the cutter
    permitted = {PREFIX + one.name: one.permitted for one in machine.fixtures}
    moving = _tool_chain(model)
    _check_names(machine, {CUTTER, *(name_of(model, geom) for geom in moving)})
    by_name = {geom.name: geom for geom in spec.geoms}
    for standing in range(model.ngeom):
        clamped = model.geom(standing).name.startswith(PREFIX)
        if standing in moving or (clamped and not (model.geom_contype[standing] or model.geom_conaffinity[standing])):
            continue
        for geom in moving:
            made = _made_for_contacts(model, geom)
            felt = collide(model, geom, standing) if made else clamped
            if not (clamped or felt):
                continue
            if slides and not can_meet(
                model, data, bounds, geom, standing, 1e-3 * MOST_CLEARANCE_MM if clamped else 0.0
            ):
                continue
            shape, body = by_name[model.geom(geom).name], by_name[model.geom(standing).name]
            name = name_of(model, geom)
            if clamped:
                shape.contype |= _CUTS if name == CUTTER else _FELT
                body.conaffinity |= _FELT if of_fixture(body.name) in yields else _FELT | _CUTS
                _firm(model, shape, made)
            if watched and name not in permitted.get(of_fixture(body.name), ()):
                sensor = spec.add_sensor(name=f"{shape.name} {body.name}", type=mujoco.mjtSensor.mjSENS_CONTACT)
                sensor.objtype = sensor.reftype = mujoco.mjtObj.mjOBJ_GEOM
                sensor.objname, sensor.refname = shape.name, body.name
                sensor.intprm[:3] = [1, 0, 1]  # found alone, as they come, one number


def _tool_chain(model: mujoco.MjModel) -> list[int]:
    """Shapes of the bodies that move against the table as the tool does, or as the portal does."""
    tool, table = (model.site(PLACES[place]).bodyid[0] for place in ("tool", "table"))
    chain = [body for body in range(1, model.nbody) if carried(model, body, tool) and not carried(model, body, table)]
    found = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if not any(carried(model, above, body) for above in chain):
            continue
        of_body = np.flatnonzero(model.geom_bodyid == body)
        has_made = any(_made_for_contacts(model, int(other)) for other in of_body)
        if _made_for_contacts(model, geom) if has_made else model.geom_group[geom] < _HULL_GROUP:
            found.append(geom)
    return found


def _made_for_contacts(model: mujoco.MjModel, geom: int) -> bool:
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def _firm(model: mujoco.MjModel, shape: mujoco.MjsGeom, made: bool) -> None:
    """Make what was only to be seen as firm as the shapes that are made for contacts."""
    like = [geom for geom in range(model.ngeom) if _made_for_contacts(model, geom) and model.geom_priority[geom] > 0]
    if not made and like:
        shape.priority = model.geom_priority[like[0]]
        shape.solref, shape.solimp = model.geom_solref[like[0]], model.geom_solimp[like[0]]


def _check_names(machine: Machine, there: set[str]) -> None:
    for fixture in machine.fixtures:
        for name in fixture.may_touch:
            if name not in there:
                known = hint(name, sorted(there), "there are")
                raise MachineError(f"{fixture.shown}.may_touch: {name!r} is no part of the machine; {known}")
