"""Projects with twins, whose sessions run in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.bridge.pytest import kept as pytest_kept
from isel_twin.core.twin import Twin

INI = """
    [pytest]
    isel_twin_plant = kinematic
    addopts = --strict-markers -p no:cacheprovider -p no:benchmark -p no:hypothesispytest
"""

PLUGIN = "isel_twin.bridge.pytest.plugin"
ALONE = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_PLUGINS": PLUGIN}
"""Environment of a pytest that has this plugin and none of those that are installed here for the tests."""


@pytest.fixture(scope="session")
def warm(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A session in this process forgets what it has imported, and some libraries do not bear to be imported twice: all
    that they import when first used is imported before."""
    import isel_twin.bridge.operate.control_port
    import isel_twin.bridge.serve.rfc2217
    import isel_twin.bridge.serve.server
    import isel_twin.bridge.virtual.protocol_twin
    import isel_twin.bridge.virtual.virtual_host
    import isel_twin.jobs.checks.asserts
    import isel_twin.plant.mujoco
    import isel_twin.recordings.replay
    import isel_twin.report.sketch  # noqa: F401

    kept = pytest_kept._Kept(Twin(plant="kinematic"), None, pytest_kept.TwinSpec(plant="kinematic"))
    kept.twin.listen(kept.note)
    kept.twin.query("@07")
    kept.twin.query("@0R7")
    folder: Path = tmp_path_factory.mktemp("warm")
    pytest_kept._record(kept, folder / "twin.mcap", folder / "twin.png")


@pytest.fixture
def drawing_project(warm: None, pytester: pytest.Pytester) -> pytest.Pytester:
    """A project whose twins follow their counters."""
    pytester.makeini(INI)
    return pytester


@pytest.fixture
def project(drawing_project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """The same with empty pictures, which cost half a second each."""

    def touch(twin: object, recorder: object, picture: Path, zero_ns: int) -> str:
        picture.touch()
        return f"picture:   {picture}"

    monkeypatch.setattr(pytest_kept, "_draw", touch)
    return drawing_project


def run(project: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """A session in this process, which leaves to this one where the report of a crash goes."""
    return project.runpytest_inprocess("-q", "-p", "no:faulthandler", *arguments)
