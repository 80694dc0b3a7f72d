#!/usr/bin/env bash
# FMPy ends a simulation before its stop time.
#
# Guess: `simulate_fmu(stop_time=0.0321, output_interval=0.01)` gives results up to 0.0321 s, or an error that it cannot.
# Seen:  with an FMU whose canHandleVariableCommunicationStepSize is false (the default of the standard) the last row is
#        that of 0.03 s. There is no warning, and the result's length is the only trace.
# Here:  a job's verdict stands in its last steps. The FMU of a twin takes steps of any size and says so.
# With:  FMPy 0.3.32, PythonFMU3 0.3.4 (makes the FMU), 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check fmpy==0.3.32 pythonfmu3==0.3.4 || exit 3

cat > clock.py <<'PY'
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64


class Clock(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time = 0.0
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )

    def do_step(self, current_time, step_size):
        return True
PY
PATH="$PWD/venv/bin:$PATH" venv/bin/python - <<'PY'
import sys

import fmpy
from pythonfmu3 import FmuBuilder

ends = {}
for variable in (False, True):
    fmu = FmuBuilder.build_FMU("clock.py", dest=".", canHandleVariableCommunicationStepSize=variable)
    fixed = fmpy.read_model_description(str(fmu)).coSimulation.canHandleVariableCommunicationStepSize
    ends[fixed] = fmpy.simulate_fmu(str(fmu), stop_time=0.0321, output_interval=0.01)["time"][-1]
    print(f"FMPy {fmpy.__version__}: canHandleVariableCommunicationStepSize={fixed}: ends at {ends[fixed]:g} s of 0.0321 s")
sys.exit(ends != {False: 0.03, True: 0.0321})
PY
