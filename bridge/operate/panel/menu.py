"""Everything an event can do, as data for the forms of the page: `ACTS` as plain text and numbers.

    {"key": "phase_lost", "meaning": "motor phases are interrupted", "by": "axis", "members": ["x", "y", "z"],
     "form": {"words": ["a", "b", "ab", ""]}, "off": "", "fault": true}

A form is one of {"number": {...}}, {"words": [...]}, {"yes": true}, {"name": "contact"} and {"table": [fields]}. For
`set` the page has buttons, from `Twin.settable`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from isel_twin.base.parameters import Limits
from isel_twin.controller import Key, Setting
from isel_twin.plant import Cut
from isel_twin.wiring.acts import ACTS, Act

# What stands in the fields of a cut at first: a small cutter in aluminium.
_FIRST = {"diameter": 6.0, "flutes": 2, "depth": 0.5, "width": 6.0, "spindle": 18_000.0, "kc": 800.0}


def menu() -> list[dict[str, Any]]:
    return [_entry(act) for act in ACTS.values() if act.by not in ("input", "key")]


def key_menu(keys: Mapping[str, Key]) -> list[dict[str, Any]]:
    """One entry for each key of the controller's own panel; without a form it is a push-button."""
    return [
        {"key": name, "meaning": key.meaning, "form": None if key.value is None else _rule(key.value), "held": key.held}
        for name, key in keys.items()
    ]


def _entry(act: Act) -> dict[str, Any]:
    return {
        "key": act.key,
        "meaning": act.meaning,
        "by": act.by,
        "members": list(act.members),
        "form": _form(act),
        "off": act.off,
        "physical": act.physical,
        "fault": act.fault,
    }


def _form(act: Act) -> dict[str, Any]:
    form = act.value
    if form == "cut":
        return {"table": [_field(item) for item in dataclasses.fields(Cut)]}
    return {"name": form} if isinstance(form, str) else _rule(form)


def _rule(rule: Setting) -> dict[str, Any]:
    if isinstance(rule, Limits):
        return {"number": _limits(rule)}
    return {"words": list(rule)} if isinstance(rule, tuple) else {"yes": True}


def _field(item: dataclasses.Field[Any]) -> dict[str, Any]:
    """A field of a cut. Material constants need a source, so they are `sourced` here: from the panel."""
    rule, key = item.metadata["rule"], item.metadata.get("key") or item.name
    default = None if item.default is dataclasses.MISSING else item.default
    if not isinstance(rule, Limits):
        return {"key": key, "first": default}
    return {"key": key, "first": _FIRST.get(key, default), "number": _limits(rule), "sourced": key == "kc"}


def _limits(rule: Limits) -> dict[str, Any]:
    return {"unit": rule.unit, "low": rule.low, "high": rule.high, "whole": rule.whole}
