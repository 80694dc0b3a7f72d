#!/usr/bin/env bash
# What `check --junit` writes, by junit2html and by Jenkins' schema junit-10.xsd, which pytest's source archive has.
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check junit2html==31.1.4 xmlschema==4.3.2 || exit 3
venv/bin/pip download --quiet --disable-pip-version-check --no-deps --no-binary :all: pytest==9.1.0 \
  || exit 3
tar -xzf pytest-9.1.0.tar.gz --strip-components=3 pytest-9.1.0/testing/example_scripts/junit-10.xsd

printf '@07\n@0R7\n' > well.txt
printf '@07\n@0Q\n' > 'odd "&<.txt'
isel-twin check well.txt 'odd "&<.txt' none.txt --plant kinematic --junit check.xml || [ $? = 1 ]
venv/bin/xmlschema-validate --schema junit-10.xsd check.xml
venv/bin/junit2html check.xml check.html
venv/bin/python - <<'PY'
import sys

from junit2htmlreport.parser import Junit

seen = {case.name: str(case.outcome()) for suite in Junit("check.xml").suites for case in suite.all()}
print(seen)
names = ["well.txt", 'odd "&<.txt', "none.txt"]
page = open("check.html").read()
sys.exit([*seen] != names or "well.txt" not in page or "no such command" not in page)
PY
