"""The result as a machine.toml with the identified numbers, based on the original machine.

    based_on = "4030"
    name = "4030-identified"

    [axes.x]
    backlash = { value = 0.0312, unit = "mm", grade = "measured", interval = [0.027, 0.036], source = "..." }

Only identified numbers are in it, and of a common factor only those that a datum moves. Their grade is `measured` if
recordings were held back and are predicted better, and nothing that the fit knows speaks against it (`Fit.measured`).
Without that it is `fitted`; so is a number that is not told apart from others of its factor, or fitted beside those
that were asked for, which hold together with it. Whatever the grade, the interval stands beside it: `--uncertain` draws
from it, and another identification begins with it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from isel_twin.base.errors import CallError
from isel_twin.base.parameters import rows
from isel_twin.base.toml import toml_line
from isel_twin.machine import Machine
from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification.fit import Estimate, Fit
from isel_twin.many.identification.unknowns import Unknown, candidate, changes
from isel_twin.models import machine_names


def based_on(name: str, machine: Machine, folder: Path) -> str:
    """The value of `based_on` for a machine.toml in that folder, for the machine `name`. Raises CallError for a folder
    from which a machine file may not name it."""
    if name in machine_names():
        return name
    if not machine.folder.is_relative_to(folder.parent):
        raise CallError(f"{folder}: must lie beside {machine.folder}, which it is based on; name a folder there")
    return Path(os.path.relpath(machine.folder, folder)).as_posix()


def patch(
    result: Fit, machine: Machine, base: str, name: str, controller: str, fitted: Sequence[str], held: Sequence[str]
) -> str:
    """The text of the machine.toml. base: from `based_on`. controller: any that moves it. fitted, held: recordings."""
    tables: dict[str, list[str]] = {}
    flags: dict[str, None] = {}
    kept = {one.key for one in result.unreached}
    alone = {key: left for one in result.alike for key, left in one.remaining.items()}
    units = {row.parameter: row.unit for row in rows(machine.tree)}
    for estimate in (*result.estimates, *result.beside):
        item = estimate.unknown
        if not estimate.identified:
            continue
        grade = "measured" if held and result.measured(estimate) else "fitted"
        if item.flag:
            flags[item.flag] = None
        unit = "" if item.unit == "1" else f" {item.unit}"
        of = "factor " if item.factor else ""
        for key in item.keys:
            if key in kept:
                continue
            table, _, last = key.rpartition(".")
            low, high, apart = estimate.low, estimate.high, ""
            if key in alone:
                half, middle = NORMAL_95 * alone[key], item.at(estimate.value)
                low, high, apart = item.value(middle - half), item.value(middle + half), ", not told apart"
            if not item.place and estimate.value >= 0.0:
                low = max(low, 0.0)
            source = f"identified from {', '.join(fitted)}: 95 % {of}{low:.4g} .. {high:.4g}{unit}{apart}"
            entry = {
                "value": _number(machine, item, key, estimate.value),
                "unit": units.get(key, item.unit),
                "grade": "fitted" if apart else grade,
                "interval": [_number(machine, item, key, low), _number(machine, item, key, high)],
                "source": source,
            }
            if item.whole:
                del entry["interval"]
            tables.setdefault(table, []).append(toml_line(last, entry))
    step_ms = _step_ms(result, machine, controller)
    if step_ms is not None:
        source = "as light and stiff as it was found to be, it needs shorter steps"
        entry = {"value": step_ms, "unit": "ms", "grade": "setting", "source": source}
        tables.setdefault("timing", []).append(toml_line("mujoco_step", entry))
    judged = ""
    if held:
        judged = f"# {', '.join(held)}, held back, predicted {result.times:.1f} times better than before.\n"
    lines = [
        f"# Identified from {', '.join(fitted)}; what the data did not tell is not in here.\n{judged}",
        toml_line("based_on", base),
        toml_line("name", name),
        toml_line("description", f"{machine.name}, as measured"),
    ]
    for table, entries in tables.items():
        lines += ["", f"[{table}]", *entries]
    if wanted := [flag for flag in flags if not getattr(machine.imperfections, flag)]:
        lines += ["", "[imperfections]", *(f"{flag} = true" for flag in wanted)]
    return "\n".join(lines) + "\n"


def _number(machine: Machine, item: Unknown, key: str, value: float) -> float:
    found = changes(machine, [item], [value])[key]
    return found if item.whole else float(f"{found:.6g}")


def _step_ms(result: Fit, machine: Machine, controller: str) -> float | None:
    """The time step that the identified machine needs, if it differs."""
    from isel_twin.many.identification.session import model_twin

    known = [estimate for estimate in (*result.estimates, *result.beside) if estimate.identified]
    found = candidate(machine, [one.unknown for one in known], [one.value for one in known])
    step_ns = model_twin(found, controller).machine.timing.mujoco_step_ns
    return None if step_ns == machine.timing.mujoco_step_ns else step_ns * 1e-6


def _told(one: Estimate) -> dict[str, Any]:
    return {
        "name": one.unknown.name,
        "keys": list(one.unknown.keys),
        "factor": one.unknown.factor,
        "unit": one.unknown.unit,
        "prior": [one.unknown.low, one.unknown.prior, one.unknown.high],
        "prior_source": one.unknown.source,
        "value": one.value,
        "interval": [one.low, one.high],
        "of_prior": one.remaining,
        "identified": one.identified,
        "note": one.note,
    }


def as_json(result: Fit, fitted: Sequence[str], held: Sequence[str]) -> dict[str, Any]:
    """The result in JSON's types, also for `isel-twin experiment --known`."""
    return {
        "parameters": [{**_told(one), "measured": bool(held) and result.measured(one)} for one in result.estimates],
        "beside": [_told(one) for one in result.beside],
        "correlation": result.correlation.tolist(),
        "covariance": result.covariance.tolist(),
        "singular_values": list(result.prospect.singular),
        "before_the_fit": list(result.prospect.lines),
        "chi2": result.chi2,
        "chi2_limit": result.chi2_limit,
        "chi2_by_kind": [asdict(one) for one in result.kinds],
        "explains": result.explains,
        "doubts": list(result.doubts),
        "unreached": [one.key for one in result.unreached],
        "not_told_apart": [{"name": one.unknown, "of_prior": one.remaining} for one in result.alike],
        "suspects": [asdict(one) for one in result.suspects],
        "laws": [asdict(one) for one in result.laws],
        "noise": [
            {"recording": one.recording, "unit": one.unit, "stated": one.stated, "sigma": one.sigma, "of": one.repeats}
            for one in result.noise
        ],
        "not_recovered": list(result.unrecovered),
        "widened": list(result.widened),
        "open": list(result.open),
        "misfits": [
            {"recording": item.recording, "kind": item.kind, "datum": item.label, "residual": r}
            for item, r in result.misfits
        ],
        "fitted": {"recordings": list(fitted), "before": result.fitted_before, "after": result.fitted_after},
        "held_out": {"recordings": list(held), "before": result.before, "after": result.after},
        "times_better": result.times if held else None,
        "promoted": not result.worse,
        "replays": result.replays,
    }
