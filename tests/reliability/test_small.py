"""The measuring programs in small: what must be right is right; how fast it is, `make reliability` tells."""

from __future__ import annotations

from types import ModuleType

import pytest

from isel_twin.firmware.imc.controller import Imc
from tests import forked
from tests.reliability import connects, echo, feed, figures, kills, memory, punctual, queries, strings, tap
from tests.reliability.figures import Figure, table

pytestmark = pytest.mark.long(seconds=4)

GENEROUS = 50.0
"""Times a limit that a computer with other things to do may take."""


@pytest.fixture(autouse=True)
def cheap_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "start", forked.start)


@pytest.mark.parametrize(
    ("program", "number"),
    [(queries, 100), (connects, 20), (kills, 2), (punctual, 1), (memory, 300), (feed, 0.1), (strings, 100), (tap, 20)],
    ids=lambda value: value.__name__.rpartition(".")[2] if isinstance(value, ModuleType) else str(value),
)
def test_in_small(program: ModuleType, number: float) -> None:
    found: list[Figure] = program.measure(number)
    assert found
    wrong = [figure.row for figure in found if figure.limit is not None and figure.value > GENEROUS * figure.limit]
    assert wrong == []


def test_an_exception_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A controller that does not bear one character of all."""
    receive = Imc.receive

    def touchy(self: Imc, t_ns: int, data: bytes) -> None:
        if b"+" in data:
            raise ZeroDivisionError
        receive(self, t_ns, data)

    monkeypatch.setattr(Imc, "receive", touchy)
    assert 0 < strings.raised("imc-s8", 200) < 100
    assert strings.raised("ismif", 200) == 0


def test_the_echo_is_compared() -> None:
    bare, twin, ratio = echo.measure(200)
    assert bare.value > 0
    assert twin.value > 0
    assert ratio.limit == 3.0


def test_a_figure_beyond_its_limit_is_marked() -> None:
    good, bad, plain = Figure("good", 1.0, "ms", 2.0), Figure("bad", 3.0, "ms", 2.0), Figure("plain", 5.0, "us")
    assert [figure.holds for figure in (good, bad, plain)] == [True, False, True]
    assert table([good, bad, plain]).splitlines()[2:] == [
        "| good | 1 ms | 2 ms |  |",
        "| bad | 3 ms | 2 ms | NO |",
        "| plain | 5 us |  |  |",
    ]
