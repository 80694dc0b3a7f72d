"""Roles: what a controller offers beside `Controller` is found in those that pass on what they are asked, too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from isel_twin.controller import HasKeys, NamesOutputs, PluginError, UsesDrives, create_controller, offers
from isel_twin.language import LoadsPlc, RetimesJobs, RunsPrograms, WritesToolpaths, create_language, language_names


class Passing:
    """Stands in for a controller and passes on what it is asked."""

    def __init__(self, inner: object) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def test_one_that_passes_on_offers_what_the_other_one_does() -> None:
    for name, roles in (("gmi99", (UsesDrives, NamesOutputs, HasKeys)), ("imc-s8", ())):
        controller = create_controller(name)
        for role in (UsesDrives, NamesOutputs, HasKeys):
            assert offers(controller, role) == offers(Passing(controller), role) == (role in roles)


def test_languages_have_roles() -> None:
    found = {name: create_language(name) for name in ("imc-s8", "gmi99", "bwo900")}
    assert [offers(found["imc-s8"], role) for role in (RetimesJobs, RunsPrograms, LoadsPlc)] == [True, False, False]
    assert offers(found["gmi99"], LoadsPlc)
    assert offers(found["bwo900"], RunsPrograms)
    assert not offers(None, RunsPrograms)
    without = {name for name in language_names() if not offers(create_language(name), WritesToolpaths)}
    assert without == {"external"}, "its toolpaths are another control's"


def test_a_part_of_a_role_is_refused_in_one_line() -> None:
    half = SimpleNamespace(keys={}, press=print)
    with pytest.raises(PluginError, match=r"^SimpleNamespace has keys, press but not key_values: HasKeys wants all"):
        offers(half, HasKeys)
