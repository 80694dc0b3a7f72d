#!/usr/bin/env bash
# A joint with dry friction creeps in MuJoCo at any force below the friction.
#
# Guess: a slide with frictionloss="100" (N) stands still under 10 N, and under 95 N.
# Seen:  it moves at a steady 2.1 mm/s under 10 N and at 20 mm/s under 95 N (5 kg, step 0.5 ms), with Newton and CG alike:
#        dry friction is a soft constraint with a regularising slope (impedance 0.9 to 0.95 by default), not a threshold.
#        A stiffer solimpfriction makes it slower, not still.
# Here:  a carriage that hangs on its guides' friction would walk off its position while the motors are off. The models
#        shipped with the twin set the impedance of their joints for it.
# With:  MuJoCo 4.0.0, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check mujoco==4.0.0 || exit 3

venv/bin/python - <<'PY'
import sys

import mujoco

MODEL = """
<mujoco>
  <option timestep="0.0005" gravity="0 0 0" solver="%s"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" frictionloss="100" solimpfriction="%s"/>
      <geom size="0.05" mass="5"/>
    </body>
  </worldbody>
  <actuator><motor joint="slide"/></actuator>
</mujoco>"""
print(f"MuJoCo {mujoco.__version__}: friction 100 N, 5 kg, speed after 2 s")
speeds = []
for solver, impedance in (("Newton", "0.9 0.95 0.001"), ("CG", "0.9 0.95 0.001"), ("Newton", "0.999 0.999 0.001")):
    for force_n in (10, 95):
        model = mujoco.MjModel.from_xml_string(MODEL % (solver, impedance))
        data = mujoco.MjData(model)
        data.ctrl[0] = force_n
        for _ in range(4000):
            mujoco.mj_step(model, data)
        speeds.append(data.qvel[0] * 1000)
        print(f"  {solver:6} solimpfriction {impedance}: {force_n:2} N: {speeds[-1]:8.4f} mm/s")
sys.exit(not (all(2 < slow < 2.2 for slow in speeds[0:4:2]) and all(19 < fast < 21 for fast in speeds[1:4:2])))
PY
