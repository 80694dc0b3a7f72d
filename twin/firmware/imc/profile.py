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
    reference_ends_limit: bool
    path_speed: bool


def settings() -> Mapping[str, Setting]:
    """Settings for machine files: the whole positive numbers and switches of the base profile."""
    number = Limits("", 1, 1e9, whole=True)
    base = _profiles()[BASE].items()
    return {key: bool if isinstance(value, bool) else number for key, value in base if isinstance(value, int)}


# readings of the manual that a setting chooses: what holds without it and with it, for people
READINGS: Mapping[str, tuple[str, str]] = {
    "path_speed": (
        "the speed of a straight move is the step frequency of its leading axis",
        "the speed of a straight move is that of the path: a diagonal takes up to 1.41, in 3D 1.73 times as long",
    ),
    "reference_ends_limit": (
        "after a limit switch the axes are set anew (@07), then the reference run",
        "after a limit switch a reference run alone is enough; the manual wants the axes set anew, too",
    ),
    "extra_values": ("@0d takes a value for each axis that is set", "@0d and @0Id take values of axes not set, too"),
    "relative_unreferenced": ("relative moves want a reference run", "relative moves go without a reference run"),
}


def readings_in_force(name: str, settings: Mapping[str, Any]) -> Mapping[str, tuple[bool, str]]:
    """Which readings hold in that profile with these settings. Raises ValueError like `load_profile`."""
    profile = load_profile(name, settings)
    return {key: (value := getattr(profile, key), words[value]) for key, words in READINGS.items()}


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
