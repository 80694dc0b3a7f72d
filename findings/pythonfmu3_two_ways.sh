#!/usr/bin/env bash
# PythonFMU3 describes one model in two ways.
#
# Guess: `pythonfmu3 build` and `FmuBuilder.build_FMU` make the same FMU of the same file.
# Seen:  with no option given, the command writes canHandleVariableCommunicationStepSize="true", the function "false". The
#        list of options holds true as the default; the function writes what stands in the empty description instead.
# Here:  an FMU of a twin is built by the function. That it takes steps of any size is said there, or importers would hold
#        it to whole steps (see fmpy_last_step.sh).
# With:  PythonFMU3 0.3.4, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check pythonfmu3==0.3.4 || exit 3

cat > still.py <<'PY'
from pythonfmu3 import Fmi3Slave


class Still(Fmi3Slave):
    def do_step(self, current_time, step_size):
        return True
PY
export PATH="$PWD/venv/bin:$PATH"
pythonfmu3 build --file still.py --dest command
python - <<'PY'
import re
import sys
import zipfile
from importlib.metadata import version

from pythonfmu3 import FmuBuilder


def described(fmu):
    text = zipfile.ZipFile(fmu).read("modelDescription.xml").decode()
    return re.search('canHandleVariableCommunicationStepSize="(.*?)"', text)[1]


by_command = described("command/Still.fmu")
by_function = described(FmuBuilder.build_FMU("still.py", dest="function"))
print(f"PythonFMU3 {version('pythonfmu3')}: steps of any size: {by_command} by the command, {by_function} by the function")
sys.exit((by_command, by_function) != ("true", "false"))
PY
