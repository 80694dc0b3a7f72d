#!/usr/bin/env bash
# Both FMUs of `fmu`: stepped by fmuloader, and linked in a container of fmucontainer, from 0 s and from 100 s.
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check fmu-manipulation-toolbox==2.0 || exit 3
venv/bin/pip install --quiet --disable-pip-version-check --target extra fmuloader==0.1.2rc0 || exit 3

isel-twin fmu serial.fmu --interface serial
isel-twin fmu steps.fmu --interface steps
cat > both.csv <<'CSV'
rule;from_fmu;from_port;to_fmu;to_port
FMU;serial.fmu;;;
FMU;steps.fmu;;;
LINK;serial.fmu;counter_x;steps.fmu;command_x
CSV
venv/bin/fmucontainer -fmi 3 -container both.csv:0.005 -auto-parameter > /dev/null
PYTHONPATH=extra python - <<'PY'
from fmpy import read_model_description, simulate_fmu
from fmuloader.fmi3 import Fmi3Slave

JOB = "@07\n@0N7\n@0A1600,2000,0,900,0,900,0,900"  # by 1600 steps, which are 5 mm

ends_mm = []
for start_s in (0.0, 100.0):
    about = read_model_description("serial.fmu")
    number = {variable.name: variable.valueReference for variable in about.modelVariables}
    fmu = Fmi3Slave("serial.fmu", model_identifier=about.coSimulation.modelIdentifier)
    fmu.instantiate_co_simulation("one", instantiation_token=about.guid)
    fmu.set_string([number["job"]], [JOB])
    fmu.enter_initialization_mode(start_time=start_s)
    fmu.exit_initialization_mode()
    for step in range(200):
        fmu.do_step(start_s + step / 100, 0.01)
    ends_mm.append(fmu.get_float64([number["position_x"]])[0])
    fmu.terminate()
    fmu.free_instance()

    output = ["position_x", "steps.position_x", "serial.counter_x"]
    said = {"start_values": {"serial.job": JOB}, "output": output, "output_interval": 0.01}
    last = simulate_fmu("both.fmu", start_time=start_s, stop_time=start_s + 2, **said)[-1]
    print(f"from {start_s:g} s: {ends_mm[-1]:.3f} mm by fmuloader, {last} in the container")
    assert last["serial.counter_x"] == 1600
    ends_mm += [last["position_x"], last["steps.position_x"]]
assert all(abs(end_mm - 5) < 0.05 for end_mm in ends_mm)
assert ends_mm[:3] == ends_mm[3:]
PY
