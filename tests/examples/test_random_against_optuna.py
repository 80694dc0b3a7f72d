"""The example at small size: repeatable, and what it prints is what it found."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from isel_twin.envs import Setup

FILE = Path(__file__).parents[2] / "docs" / "examples" / "random_against_optuna.py"


def test_both_searches_get_better_and_the_table_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = importlib.util.spec_from_file_location("random_against_optuna", FILE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    small = Setup(job=[(30, 0, 0)], settle_s=0.05)
    found = example.compare(4, 1, small)
    again = example.best_so_far(example.SAMPLERS["Optuna"](0), small, 4)
    assert found["Optuna"] == [again]
    for runs in found.values():
        assert runs[0] == sorted(runs[0], reverse=True)
        assert runs[0][-1] < 100.0, "one of them lost nothing"
    monkeypatch.setattr(example, "compare", lambda trials, seeds: found)
    example.main(["--trials", "4", "--seeds", "1"])
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[-2:] == ["4", "trials"]
    for row, (name, runs) in zip(rows, found.items(), strict=True):
        assert row.startswith(name)
        assert row.endswith(f"{runs[0][-1]:.2f} ({runs[0][-1]:.2f})")
