"""What the bytes of a controller mean: the second border of a controller, for people and tools.

language.py   what a language is
roles.py      optional abilities: settings for jobs, programs as jobs, PLC programs, toolpaths, acts of a session
registry.py   which ones are installed, by entry points
text.py       helpers for languages whose bytes are text
"""

from __future__ import annotations

from isel_twin.language.language import (
    SETTINGS_RANGES,
    Language,
    LanguageError,
    Message,
    MoveSettings,
    Ranges,
    check_ranges,
)
from isel_twin.language.registry import (
    LanguageFactory,
    create_language,
    language_factory,
    language_names,
    needed,
    programs_for,
    set_points_language,
)
from isel_twin.language.roles import (
    Act,
    Example,
    FlashSetting,
    HasExample,
    HoldsMotion,
    JobMove,
    KnowsBeginnings,
    KnowsCommands,
    LoadsPlc,
    RetimesJobs,
    RunsPrograms,
    TakesSetPoints,
    TellsActs,
    TellsCounters,
    WritesToolpaths,
)
from isel_twin.language.text import Pieces, encoded, integers, readable

__all__ = [
    "SETTINGS_RANGES",
    "Act",
    "Example",
    "FlashSetting",
    "HasExample",
    "HoldsMotion",
    "JobMove",
    "KnowsBeginnings",
    "KnowsCommands",
    "Language",
    "LanguageError",
    "LanguageFactory",
    "LoadsPlc",
    "Message",
    "MoveSettings",
    "Pieces",
    "Ranges",
    "RetimesJobs",
    "RunsPrograms",
    "TakesSetPoints",
    "TellsActs",
    "TellsCounters",
    "WritesToolpaths",
    "check_ranges",
    "create_language",
    "encoded",
    "integers",
    "language_factory",
    "language_names",
    "needed",
    "programs_for",
    "readable",
    "set_points_language",
]
