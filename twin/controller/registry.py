"""The installed controllers, by entry points in the group `isel_twin.controllers` (docs/controllers.md)."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, TypeAlias, TypeVar

from isel_twin.base.parameters import Limits
from isel_twin.base.plugins import installed
from isel_twin.controller.controller import Controller

# factory(name, *, flash: bytes | None, settings: Mapping[str, Any]) -> Controller, `name` being the entry point's
ControllerFactory = Callable[..., Controller]


class UnknownNameError(ValueError):
    """A name of a controller, machine or the like is unknown; the message lists the known ones."""


# kinds of settings: a number within limits, one of some words (none: any text), or true and false
Setting: TypeAlias = Limits | tuple[str, ...] | type[bool]

Factory = TypeVar("Factory", bound=Callable[..., Any])


# of a controller's name and the settings it is given: readings of the manual in force, value and words, by setting
InForce: TypeAlias = Callable[[str, Mapping[str, Any]], Mapping[str, tuple[bool, str]]]


def takes(settings: Mapping[str, Setting], in_force: InForce | None = None) -> Callable[[Factory], Factory]:
    """Declare the settings that a factory takes: machine files with others are refused when they are read. in_force:
    which readings of its manual hold, for `describe`.

    @takes({"program_memory_bytes": Limits("byte", 1, 1e9, whole=True)})
    def create(name, *, flash, settings): ...
    """

    def told(factory: Factory) -> Factory:
        factory.settings, factory.in_force = settings, in_force  # type: ignore[attr-defined]
        return factory

    return told


class PluginError(ValueError):
    """An installed controller or language does not work; the message is one line with its name and the reason."""


_GROUP = "isel_twin.controllers"


def controller_names() -> list[str]:
    """Names of all installed controllers, sorted."""
    return sorted(entry.name for entry in installed(_GROUP))


def create_controller(
    name: str, *, flash: bytes | None = None, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Build the controller called `name`, with the flash image it had at its last power-off (None: a new device).

    Raises UnknownNameError for an unknown name, PluginError if the controller does not work, and ValueError for
    settings that it does not take.
    """
    return controller_factory(name)(flash, settings or {})


def controller_factory(name: str) -> Callable[[bytes | None, Mapping[str, Any]], Controller]:
    """A function of flash image and settings that builds the controller called `name`. The look-up takes ten
    milliseconds, building much less. Both raise what `create_controller` raises.
    """
    return partial(_build, *_loaded(name))


def _loaded(name: str) -> tuple[importlib.metadata.EntryPoint, ControllerFactory]:
    for entry in installed(_GROUP):
        if entry.name == name:
            with plugin_errors("controller", entry):
                factory: ControllerFactory = entry.load()
            return entry, factory
    raise UnknownNameError(f"unknown controller {name!r}; installed: {', '.join(controller_names())}")


def _build(
    entry: importlib.metadata.EntryPoint, factory: ControllerFactory, flash: bytes | None, settings: Mapping[str, Any]
) -> Controller:
    with plugin_errors("controller", entry, ValueError):
        return factory(entry.name, flash=flash, settings=settings)


def controller_settings(wanted: Iterable[str]) -> Mapping[str, Setting]:
    """Settings that installed, working controllers take, by name; controllers are loaded until all `wanted` are
    found."""
    if not set(wanted) <= _settings.keys():
        for entry in installed(_GROUP):
            with suppress(PluginError), plugin_errors("controller", entry):
                _settings.update(getattr(entry.load(), "settings", {}))
            if set(wanted) <= _settings.keys():
                break
    return _settings


_settings: dict[str, Setting] = {}


def readings_in_force(name: str, settings: Mapping[str, Any]) -> Mapping[str, tuple[bool, str]]:
    """Readings of its manual that hold in this controller with these settings: value and words, by setting. Raises what
    `create_controller` raises."""
    entry, factory = _loaded(name)
    in_force: InForce | None = getattr(factory, "in_force", None)
    with plugin_errors("controller", entry, ValueError):
        return {} if in_force is None else in_force(name, settings)


@contextmanager
def plugin_errors(what: str, entry: importlib.metadata.EntryPoint, *passed: type[Exception]) -> Iterator[None]:
    """Turn exceptions of a plug-in into a PluginError of one line; errors of the kinds `passed` stay."""
    try:
        yield
    except passed:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise PluginError(f"{what} {entry.name!r} ({entry.value}) does not work: {reason}") from error
