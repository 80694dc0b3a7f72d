"""Mechanical energy of a built machine."""

from __future__ import annotations

import numpy as np
from drives.axis import rigs

from isel_twin.native import core
from isel_twin.plant.prepared import Built


def mechanical_energy_j(built: Built) -> float:
    """Energy of everything, J: moving masses and their height, rotors, detents, nuts, structure; at the last whole
    sub-step.

    The structure is not there yet, but at the start of MuJoCo's step, a time of t ago: it is taken on by a step of t
    with the forces there have been since. Its weights and springs have done the work that they do in such steps,
    F (v + v') t / 2 with F as at the start: so springs hold k q_n q_n-1 / 2 at the ends of MuJoCo's steps, which, with
    kinetic energy, is constant for whatever swings freely.
    """
    parts, model, data, dof = built.parts, built.model, built.data, built.dof
    axes, plant, cut, stiffness = parts.axes, parts.plant[0], parts.cut[0], model.jnt_stiffness[model.dof_jntid]
    drives = sum(
        rigs.stored_energy_j(parts.drives[i : i + 1], parts.states[i : i + 1], axes["x_m"][i] - axes["zero_m"][i])
        for i in range(len(axes))
    )
    rates, went_s = data.qvel.copy(), 0.0
    made = 0 if plant["frozen"] else int(plant["now"] % plant["window"])
    if made:
        forces_n = parts.push[0] + parts.push[1] / made
        forces_n += np.array([cut["sum_x_n"], cut["sum_y_n"]]) @ parts.tip_joints[:2] / made
        forces_n[dof] += axes["sum_n"] / made
        went_s = 1e-9 * made * built.machine.timing.substep_ns
        scratch = np.empty((3, len(rates)))
        scratch[0] = data.qpos
        core.glide_once(parts.joints_law.copy(), parts.mobility, went_s, scratch[0], rates, *scratch[1:], forces_n)
    way = 0.5 * went_s * (data.qvel + rates)
    rates[dof] = axes["v_m_s"]
    joints = 0.5 * (parts.before + data.qpos) + way
    joints[dof] = axes["x_m"]
    springs = (stiffness * data.qpos) @ (0.5 * parts.before + way)
    return float(drives + 0.5 * rates @ built.inertia @ rates + springs + built.weight @ joints)
