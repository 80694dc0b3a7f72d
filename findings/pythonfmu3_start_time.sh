#!/usr/bin/env bash
# PythonFMU3 does not tell a model when its simulation starts.
#
# Guess: `setup_experiment(start_time)` of a model is called before initialisation ends, as it is in FMUs of FMI 2.0, with
#        the startTime that the importer gave to fmi3EnterInitializationMode.
# Seen:  it is never called: the wrapper takes the start time and drops it. A model hears of time in its first do_step.
# Here:  virtual time of a twin counts from its power-on. Taken for the communication point itself, a simulation from 100 s
#        on played 100 s of machining in its first step. The twin takes the first communication point as its start.
# With:  PythonFMU3 0.3.4, FMPy 0.3.32 (runs the FMU), 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check fmpy==0.3.32 pythonfmu3==0.3.4 || exit 3

cat > heard.py <<'PY'
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64


class Heard(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.told, self.first, self.time = -1.0, -1.0, 0.0
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        for name in ("told", "first"):
            self.register_variable(Float64(name, causality=Fmi3Causality.output))

    def setup_experiment(self, start_time):
        self.told = start_time

    def do_step(self, current_time, step_size):
        if self.first < 0:
            self.first = current_time
        return True
PY
PATH="$PWD/venv/bin:$PATH" venv/bin/python - <<'PY'
import sys
from importlib.metadata import version

import fmpy
from pythonfmu3 import FmuBuilder

fmu = str(FmuBuilder.build_FMU("heard.py", dest="."))
end = fmpy.simulate_fmu(fmu, start_time=100.0, stop_time=101.0, output_interval=0.5)[-1]
print(f"PythonFMU3 {version('pythonfmu3')}: a simulation from 100 s: setup_experiment told {end['told']:g}", end=" ")
print(f"(-1: never), the first step begins at {end['first']:g} s")
sys.exit((end["told"], end["first"]) != (-1.0, 100.0))
PY
