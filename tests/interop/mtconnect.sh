#!/usr/bin/env bash
# Devices.xml of `mtconnect` by the standard's schemas 2.0 to 2.4, which no package index has: SCHEMAS names a folder of
# them, MTConnectDevices_2.4.xsd and xlink.xsd among them (the public repository mtconnect/schema).
set -euo pipefail
schemas="$(realpath "${SCHEMAS:-.}")"
[ -f "$schemas/MTConnectDevices_2.4.xsd" ] || { echo "SCHEMAS names no folder of MTConnect's schemas" >&2; exit 3; }
cd "$(mktemp -d)" && trap 'kill $(jobs -p) 2> /dev/null; wait; rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check xmlschema==4.3.2 || exit 3

isel-twin serve --plant kinematic --tcp 127.0.0.1:0 --control 127.0.0.1:0 > served &
timeout 300 sh -c 'until grep -qs control served; do sleep 0.2; done'
control="$(sed 's/.*"control": "\([^"]*\)".*/\1/' served)"
isel-twin mtconnect "$control" --tcp 127.0.0.1:0 --devices Devices.xml > beside &
timeout 300 sh -c 'until grep -qs mtconnect beside; do sleep 0.2; done'
venv/bin/python - "$schemas" <<'PY'
import pathlib
import sys

import xmlschema

HEADER = '<Header creationTime="2026-01-01T00:00:00Z" sender="agent" instanceId="1" version="{}.0.0" bufferSize="1"'
HEADER += ' deviceModelChangeTime="2026-01-01T00:00:00Z" assetBufferSize="1" assetCount="0"/>'  # an agent fills it in
devices = pathlib.Path("Devices.xml").read_text()
for number in ("2.0", "2.1", "2.2", "2.3", "2.4"):
    schema = xmlschema.XMLSchema11(f"{sys.argv[1]}/MTConnectDevices_{number}.xsd")
    text = devices.replace("Devices:2.0", f"Devices:{number}")
    text = text.replace("<Devices>", HEADER.format(number) + "<Devices>", 1)
    schema.validate(text)
    print(number, "valid")
    assert not schema.is_valid(text.replace("Door ", "Doors ").replace("</Door>", "</Doors>"))
PY
