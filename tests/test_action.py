"""The files that other people's CI takes: the composite action's script as its host would run it, hooks, container."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from isel_twin.cli import app

ROOT = Path(__file__).parents[1]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
STEP = next(step for step in ACTION["runs"]["steps"] if step.get("id") == "check")


@pytest.mark.parametrize(("speed", "code"), [(800, 0), (45_000, 1)])
def test_the_script_fails_the_pull_request_and_says_where(speed: int, code: int, tmp_path: Path) -> None:
    """In a workspace with two jobs, one of them with a speed that is refused."""
    place = tmp_path / "isel-twin" / "venv" / "bin"
    place.mkdir(parents=True)
    (place / "isel-twin").symlink_to(Path(sys.executable).parent / "isel-twin")
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs" / "a.txt").write_text("@07\n@0N7\n")
    (tmp_path / "jobs" / "b.txt").write_text(f"@07\n@0N7\n@0A800,{speed},0,30,0,30,0,30\n")
    files = {name: tmp_path / name for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
    inputs = {"JOBS": "jobs/*.txt", "ARGS": "--plant kinematic", "PACKAGE": "isel-twin"}
    environment = {**os.environ, **inputs, **{key: str(path) for key, path in files.items()}}
    environment |= {"GITHUB_ACTIONS": "true", "RUNNER_TEMP": str(tmp_path), "GITHUB_WORKSPACE": str(tmp_path)}
    done = subprocess.run(
        ["bash", "-c", STEP["run"]], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    assert files["GITHUB_OUTPUT"].read_text() == f"ok={'false' if code else 'true'}\n"
    assert "jobs/b.txt" in files["GITHUB_STEP_SUMMARY"].read_text()
    assert ("::error file=jobs/b.txt,line=3" in done.stdout) == bool(code)
    assert json.loads((tmp_path / "isel-twin.sarif").read_text())["version"] == "2.1.0"


def test_no_input_is_pasted_into_the_script() -> None:
    assert "${{" not in STEP["run"]


def test_the_hooks_call_what_there_is() -> None:
    for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text()):
        app.parse_args([*hook["entry"].split()[1:], "job.txt"], print_error=False, exit_on_error=False)


def test_the_component_and_the_container_do_so_too() -> None:
    folder = ROOT / "docs" / "examples" / "ci"
    head, job = yaml.safe_load_all((folder / "gitlab-check.yml").read_text())
    assert {"jobs", "package", "stage"} == set(head["spec"]["inputs"])
    assert "isel-twin check $[[ inputs.jobs ]] --junit isel-twin.xml" in job["isel-twin-check"]["script"]
    container = (folder / "Containerfile").read_text()
    assert 'ENTRYPOINT ["isel-twin"]' in container
