"""The options of each command, read from its signature once in a process: cyclopts does that anew for every call, which
is two thirds of a short call of the command line."""

from __future__ import annotations

from copy import copy
from typing import Any

from cyclopts import App
from cyclopts.argument import Argument, ArgumentCollection

_assemble = App.assemble_argument_collection
_known: dict[tuple[Any, ...], tuple[App, ArgumentCollection]] = {}


def _once(app: App, **how: Any) -> ArgumentCollection:
    key = id(app), id(app.default_command), *sorted(how.items())
    if key not in _known:
        _known[key] = app, _assemble(app, **how)  # the app, so that no other gets its id
    return _blank(_known[key][1], {})


def _blank(arguments: ArgumentCollection, made: dict[int, Argument]) -> ArgumentCollection:
    """Copies that know of no word of any call."""
    return ArgumentCollection(made.get(id(each)) or _copied(each, made) for each in arguments)


def _copied(argument: Argument, made: dict[int, Argument]) -> Argument:
    other = made[id(argument)] = copy(argument)
    other.tokens, other.children = [], _blank(argument.children, made)
    return other


App.assemble_argument_collection = _once  # type: ignore[method-assign, assignment]
