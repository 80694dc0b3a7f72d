#!/usr/bin/env bash
# Rerun converts frames and log of what `export` makes.
set -euo pipefail
[ -z "${CI:-}" ] || { echo "Rerun is most of a gigabyte: not in CI" >&2; exit 3; }
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check rerun-sdk==0.41.0 || exit 3

printf '@07\n@0R7\n@0A1600,3000,0,30,0,30,0,30\n' > job.txt
isel-twin run job.txt --plant kinematic --record session.mcap > /dev/null
isel-twin export session.mcap view.mcap
venv/bin/rerun mcap convert view.mcap -o view.rrd 2> /dev/null
venv/bin/rerun rrd stats view.rrd > told 2> /dev/null
for component in TextLog:text Transform3D:translation; do grep "$component" told; done
