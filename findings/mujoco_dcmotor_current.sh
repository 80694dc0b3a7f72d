#!/usr/bin/env bash
# MuJoCo's DC motor with a limit of current carries twelve times that current.
#
# Guess: saturation="0 2 0" (a current of 2 A at most) on a motor with inductance keeps the current in the winding at 2 A;
#        when its voltage is taken away the torque begins to fall at once, with the winding's time constant L/R.
# Seen:  only the force is held back. The current, the actuator's activation, goes on to U/R = 24 A. When the voltage goes to
#        0 the full torque stays for L/R ln(24/2) = 5 ms, as the surplus has to die away first.
# Here:  a chopper holds the current of a winding; a drive whose torque ends 5 ms late reverses late. The twin's motors are
#        its own law, with a current that the stage holds.
# With:  MuJoCo 4.0.0, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 || exit 3

venv/bin/python - <<'PY'
import sys

import mujoco

MODEL = """
<mujoco>
  <option timestep="0.0001" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="shaft" type="hinge" axis="0 0 1" armature="1000"/>
      <geom size="0.05" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <dcmotor joint="shaft" motorconst="0.05" resistance="1" inductance="0.002" saturation="0 2 0"/>
  </actuator>
</mujoco>"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.ctrl[0] = 24
for _ in range(300):
    mujoco.mj_step(model, data)
current, torque = data.act[0], data.actuator_force[0]
print(f"MuJoCo {mujoco.__version__}: 24 V at 1 ohm, limit 2 A: current {current:.2f} A, torque {torque:.3f} Nm")
data.ctrl[0] = 0
late_s = 0.0
while data.actuator_force[0] > 0.0999 and late_s < 1:
    mujoco.mj_step(model, data)
    late_s += model.opt.timestep
print(f"voltage 0: torque begins to fall after {late_s * 1000:.1f} ms")
sys.exit(not (23.9 < current < 24.1 and abs(torque - 0.1) < 1e-9 and 0.0048 < late_s < 0.0052))
PY
