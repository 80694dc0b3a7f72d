"""The installed languages, by entry points in the group `isel_twin.languages`, named like their controllers."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import NoneType
from typing import Any

from isel_twin.base.plugins import installed
from isel_twin.controller import PluginError, UnknownNameError, controller_names, offers, plugin_errors
from isel_twin.language.language import Language, LanguageError
from isel_twin.language.roles import RunsPrograms, TakesSetPoints

# factory(name) -> a fresh Language, `name` being the entry point's and the controller's
LanguageFactory = Callable[[str], Language]

_GROUP = "isel_twin.languages"
_PROGRAMS = "isel_twin.programs"


def language_names() -> list[str]:
    """Names of all controllers whose language is installed, sorted."""
    return sorted(entry.name for entry in installed(_GROUP))


def set_points_language() -> tuple[str, Any]:
    """Name and language of the controller that takes another control's set points. Raises UnknownNameError."""
    for name in language_names():
        if offers(language := create_language(name), TakesSetPoints):
            return name, language
    raise UnknownNameError("no installed controller takes set points")


def create_language(controller: str) -> Language | None:
    """A fresh language of the controller with this name, None if it has none.

    Raises UnknownNameError if no installed controller has that name either, PluginError if the language does not work.
    """
    return language_factory(controller)()


def language_factory(controller: str) -> Callable[[], Language | None]:
    """A function that makes a fresh language of this controller, or returns None if it has none. The look-up takes ten
    milliseconds, making one much less. Both raise what `create_language` raises.
    """
    for entry in installed(_GROUP):
        if entry.name == controller:
            with plugin_errors("language", entry):
                factory: LanguageFactory = entry.load()
            return partial(_build, entry, factory)
    if controller not in (names := controller_names()):
        raise UnknownNameError(f"unknown controller {controller!r}; installed: {', '.join(names)}")
    return NoneType  # NoneType() is None


def programs_for(text: str) -> list[str]:
    """Names of the installed controllers whose language claims this text (`RunsPrograms.claims`), sorted. Only
    languages also installed as `isel_twin.programs` are loaded, so that a job loads only its own controller. One that
    does not work claims nothing: naming its controller shows the error.
    """
    found: list[str] = []
    for entry in installed(_PROGRAMS):
        with suppress(PluginError):
            language = create_language(entry.name)
            if offers(language, RunsPrograms) and language.claims(text):
                found.append(entry.name)
    return sorted(found)


def _build(entry: importlib.metadata.EntryPoint, factory: LanguageFactory) -> Language:
    with plugin_errors("language", entry):
        return factory(entry.name)


def needed(language: Language | None, controller: str) -> Language:
    """The language. Raises LanguageError if there is none."""
    if language is None:
        raise LanguageError(f"controller {controller!r} has no language: send its bytes as <13> or by write()")
    return language
