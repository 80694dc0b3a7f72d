#!/usr/bin/env bash
# pyvisa with pyvisa-py drives a served twin as docs/hosts.md says.
set -euo pipefail
page="$(realpath "$(dirname "$0")/../../docs/hosts.md")"
cd "$(mktemp -d)" && trap 'kill $(jobs -p) 2> /dev/null; wait; rm -rf "$PWD"' EXIT
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyvisa==1.16.2 pyvisa-py==0.8.1 pyserial==3.5 || exit 3

isel-twin serve --speed max --pty "$PWD/imc" > served &
timeout 300 sh -c 'until grep -qs pty served; do sleep 0.2; done'
(echo import pyvisa; sed -n '/^\*\*pyvisa\*\*/,/^\*\*/s/^    //p' "$page") | sed "s#/tmp/imc#$PWD/imc#" | tee host.py
venv/bin/python host.py
