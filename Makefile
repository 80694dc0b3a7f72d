# isel-twin: every command works on a bare checkout; the virtual environment is made when it is missing.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help demo test thorough quick bench conformance golden lint types format clean

help:                ## show the commands
	@grep -hE '^[a-z-]+: .*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 16

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "isel-twin needs Python 3.11 or newer; set PYTHON=/path/to/python3.11" >&2; exit 2; }
	@echo "making $(VENV) and installing what is needed: a minute or two, in silence" >&2
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	@touch $@

.PHONY: core
core: $(READY)       ## compile the C of the checkout and show what the compiler says; else the next use does it in silence
	$(BIN)/python twin/native/compiling.py

demo: $(READY)       ## a host program drives the twin through a pseudo-terminal
	@$(BIN)/python -m isel_twin.bridge.demo

test: $(READY)       ## all tests, each file on one of four workers, as many wait for browsers and ports
	$(BIN)/python -m pytest --numprocesses 4 --dist loadfile --no-loadscope-reorder $(PROFILE)

thorough: PROFILE := --hypothesis-profile thorough
thorough: test       ## the same, with four times as many of the worlds that are drawn at random


QUICK := \
	tests/bridge/test_uart.py tests/bridge/test_pacing.py tests/bridge/test_protocol_twin.py tests/test_language.py \
	tests/conformance/test_imc_replies.py tests/conformance/test_imc_reference.py tests/conformance/test_ismif_commands.py \
	tests/conformance/test_gmi99_moves.py tests/conformance/test_bwo900_cycles.py tests/conformance/test_bwo900_modes.py \
	tests/firmware/plc tests/firmware/test_executor.py tests/firmware/imc/test_safety.py tests/firmware/ismif/test_commands.py \
	tests/firmware/gmi99/test_planner.py tests/firmware/bwo900/test_corners.py tests/motion tests/wiring \
	tests/drives/test_data.py tests/drives/test_servo.py tests/drives/test_step_loss.py tests/plant/test_thresholds.py \
	tests/plant/test_supply.py tests/plant/test_cutting.py tests/models/test_models.py tests/models/test_machine.py \
	tests/cam/test_ncp.py tests/cam/test_gcode.py tests/cam/test_hpgl.py tests/cam/test_excellon.py \
	tests/interop/rs274 tests/interop/gerbv tests/cli/test_job.py \
	tests/capture/test_ticks.py tests/recordings/test_write.py tests/recordings/test_mcap.py \
	tests/test_twin.py tests/test_position.py tests/test_snapshot.py tests/test_spec.py tests/test_testing.py \
	tests/test_jobs.py tests/test_verdict.py tests/test_decisions.py tests/test_borders.py
quick: $(READY)      ## a little of every room, in less than a minute
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile -m "not slow" $(QUICK)

.PHONY: lowest others
lowest: $(READY)     ## every command once with the lowest versions of libraries that are allowed
	$(BIN)/python -m tests.versions lowest

others: $(READY)     ## the quick tests and every command once on the other interpreters of 3.11 to 3.14 that are found
	$(BIN)/python -m tests.versions others

bench: $(READY)      ## speed and memory, as ratios measured side by side
	$(BIN)/python -m pytest tests/bench/bench_*.py --benchmark-only --benchmark-columns=median,ops --benchmark-sort=name

RELEASE := build/release
USER := build/user
.PHONY: sbom audit
$(RELEASE)/.ready:
	$(PYTHON) -m venv $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --disable-pip-version-check build twine cyclonedx-bom \
	  "setuptools>=77.0.1" "ziglang>=0.13,<0.18"
	@touch $@

$(USER)/.ready: pyproject.toml
	$(PYTHON) -m venv --clear $(USER)
	$(USER)/bin/python -m pip install --quiet --disable-pip-version-check .
	@touch $@

sbom: $(RELEASE)/.ready $(USER)/.ready ## what an installation contains, as build/isel-twin.cdx.json (CycloneDX)
	$(RELEASE)/bin/cyclonedx-py environment $(USER)/bin/python --pyproject pyproject.toml --output-reproducible \
	  --output-file build/isel-twin.cdx.json

audit: $(READY)      ## what an installation brings against the public database of advisories, where an index answers
	@$(BIN)/python -m tests.audit

.PHONY: package
package: $(RELEASE)/.ready ## source archive and this machine's wheel in dist/, checked, and the wheel tried in an environment of its own
	rm -rf dist build/lib build/clean build/shop
	$(RELEASE)/bin/python -m tests.release here
	$(RELEASE)/bin/twine check --strict dist/*
	$(PYTHON) -m venv build/clean
	build/clean/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	build/clean/bin/isel-twin doctor
	build/clean/bin/isel-twin init build/shop
	cd build/shop && ../clean/bin/isel-twin check jobs/*

.PHONY: wheels
wheels: $(RELEASE)/.ready ## source archive in dist/, and a wheel for each machine that there is one for
	$(RELEASE)/bin/python -m tests.release everywhere
	$(RELEASE)/bin/twine check --strict dist/*

.PHONY: release
REPOSITORY ?=
release: $(RELEASE)/.ready ## REPOSITORY=https://HOST/OWNER/NAME: the commit's files for a package index in dist/, built twice alike
	$(RELEASE)/bin/python -m tests.release "$(REPOSITORY)"
	$(RELEASE)/bin/twine check --strict dist/*

.PHONY: site docs-run
docs-run: $(READY) ## run what the pages print and compare the answers; takes ten minutes of two quiet cores
	@$(BIN)/python -m tests.printed

site: build/site/.ready ## the pages as a site in build/site/html; a broken link fails
	build/site/bin/sphinx-build -W --keep-going -q -b html docs build/site/html
build/site/.ready:
	$(PYTHON) -m venv build/site
	build/site/bin/python -m pip install --quiet --disable-pip-version-check sphinx myst-parser furo
	@touch $@

.PHONY: findings
findings:            ## surprises of other libraries and tools, each run once more; needs a network
	@failed=; for script in findings/*.sh; do \
	  echo "$$script"; bash $$script || failed="$$failed $$script ($$?)"; done; \
	  if [ -n "$$failed" ]; then echo "no longer so, or not to be had (3):$$failed"; exit 1; fi

.PHONY: interop
INTEROP ?= $(wildcard tests/interop/*.sh)
interop: $(READY)    ## programs of others, in temporary folders, read what is written here (docs/interop.md); needs a network
	@failed=; for script in $(INTEROP); do \
	  echo "$$script"; PATH="$(CURDIR)/$(BIN):$$PATH" bash $$script && continue; code=$$?; \
	  if [ $$code = 3 ]; then echo "$$script: not to be had here"; else failed="$$failed $$script"; fi; done; \
	  if [ -n "$$failed" ]; then echo "not read as docs/interop.md says:$$failed"; exit 1; fi

.PHONY: browser
browser: $(READY)    ## a browser for the tests of the panel, if it can be had; without one they are skipped
	@$(BIN)/python -m tests.panel.chromium

.PHONY: reliability
reliability: $(READY) ## what a server that runs for weeks must hold; takes half an hour of a quiet computer
	$(BIN)/python -m tests.reliability

.PHONY: hunt
HUNT ?= 1000
hunt: $(READY)       ## random worlds, each from a seed: HUNT=1000 of them, or HUNT=FIRST:LAST, on all cores
	@$(BIN)/python -m tests.hunt --seeds $(HUNT)

conformance: $(READY) ## every observable statement of the manuals, and the tests that show it
	$(BIN)/python -m tests.conformance.report

.PHONY: sanitize
sanitize: $(READY)   ## tests of the compiled core with AddressSanitizer and UBSan, if gcc has them; says so if not
	@$(BIN)/python -m tests.sanitize

.PHONY: mutants
MUTANTS ?= 100
SEED ?= 1
mutants: $(READY)    ## change the package in one place at a time, MUTANTS=100 of SEED=1: do the tests notice? takes hours
	nice $(BIN)/python tests/mutants.py --sample $(MUTANTS) --seed $(SEED)

golden: $(READY)     ## digest behaviour anew after a deliberate change
	$(BIN)/python -m pytest -q --update-golden tests/golden tests/conformance

lint: $(READY)       ## ruff: rules and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)      ## mypy over an installed (not editable) copy
	rm -rf build
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --target build/installed .
	MYPYPATH=build/installed $(BIN)/mypy --cache-dir=.mypy_cache -p isel_twin

format: $(READY)     ## let ruff put the code in order
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:               ## remove what the other commands made
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
