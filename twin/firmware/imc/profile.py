"""Controller profiles: the differences between members of the family, as data (profiles.toml)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from typing import Any

from isel_twin.base.parameters import Limits
from isel_twin.controller import Setting

BASE = "imc-s8"


@dataclass(frozen=True)
class Profile:
    """One member of the family; profiles.toml has the meaning, unit and origin of each field."""

    name: str
    min_speed_hz: int
    max_speed_hz: int
    reference_hz: tuple[int, ...]
    run_free_steps: tuple[int, ...]
    start_stop_hz: int
    acceleration_hz_per_ms: int
    limit_switches: int
    step_out_hz: int
    search_steps: int
    leave_steps: int
    settle_ms: int
    debounce_ms: int
    relay_ms: int
    cycle_ms: int
    erase_ms: int
    store_ms: int
    line_bytes: int
    input_bytes: int
    program_memory_bytes: int
    loop_depth: int
    acknowledge_at_once: str
    spindle_port: int
    unknown_commands: tuple[str, ...]
    extra_values: bool
    relative_unreferenced: bool
    set_axes_only: bool


def settings() -> Mapping[str, Setting]:
    """Settings for machine files: the whole positive numbers and switches of the base profile."""
    number = Limits("", 1, 1e9, whole=True)
    base = _profiles()[BASE].items()
    return {key: bool if isinstance(value, bool) else number for key, value in base if isinstance(value, int)}


def load_profile(name: str, settings: Mapping[str, Any]) -> Profile:
    """The profile called `name` with the numbers and switches in `settings`; other settings are ignored.

    Raises ValueError if a setting is not a positive whole number, or not true or false where the profile has that.
    """
    profiles = _profiles()
    values = profiles[BASE] | profiles[name]
    for key, value in settings.items():
        if key not in values or not isinstance(values[key], int):
            continue
        if isinstance(values[key], bool):
            if not isinstance(value, bool):
                raise ValueError(f"controller setting {key} = {value!r}: give true or false")
        elif isinstance(value, bool) or not isinstance(value, int) or value <= 0:
            raise ValueError(f"controller setting {key} = {value!r}: give a positive whole number")
        values[key] = value
    as_tuples: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in values.items()}
    return Profile(**{field.name: as_tuples[field.name] for field in fields(Profile)})


@cache
def _profiles() -> Mapping[str, dict[str, Any]]:
    return tomllib.loads(files(__package__).joinpath("profiles.toml").read_text("utf-8"))
