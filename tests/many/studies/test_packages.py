"""Packages that a sweep needs and may not be there."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from isel_twin.cli import main

PLAN = '[sweep]\njob = "job.txt"\nplant = "kinematic"\nstart_mm = [2, 2, 2]\n[job]\nspeed = [1]\n'


@pytest.mark.parametrize(
    ("package", "words", "line"),
    [
        ("pyarrow", "grid.toml", "a table needs pyarrow: pip install 'isel-twin[tune]'"),
        ("scipy.stats", "ranges.toml", "samples need scipy: pip install 'isel-twin[tune]'"),
        (
            "distributed",
            "grid.toml --cluster tcp://a:1",
            "--cluster needs distributed: pip install 'isel-twin[cluster]'",
        ),
        ("SALib", "grid.toml --sensitivity a.png", "--sensitivity needs SALib: pip install 'isel-twin[tune]'"),
        (
            "matplotlib",
            "grid.toml --sensitivity a.png",
            "--sensitivity a.png: needs matplotlib: pip install 'isel-twin[report]'",
        ),
    ],
)
def test_who_lacks_a_package_is_told_what_to_install(
    plans: Path,
    package: str,
    words: str,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.chdir(plans)
    (plans / "job.txt").write_text("@07\n@0R7\n# {speed}\n", encoding="utf-8")
    (plans / "grid.toml").write_text(PLAN, encoding="utf-8")
    ranged = PLAN.replace("[1]", "{ low = 1, high = 2 }").replace("[job]", "samples = 2\n[job]")
    (plans / "ranges.toml").write_text(ranged, encoding="utf-8")
    with pytest.raises(SystemExit) as caught:
        main(["sweep", *words.split()])
    assert (caught.value.code, capsys.readouterr().err) == (2, f"isel-twin: {line}\n")
    assert not list(plans.glob("*.parquet*"))
