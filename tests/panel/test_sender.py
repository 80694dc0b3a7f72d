"""A job held at any moment of its virtual time, without a server's thread or clock."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from isel_twin import Twin
from isel_twin.bridge.operate.panel.sender import Sender
from isel_twin.jobs.job import parse_job
from tests.panel.test_desk import HELD

MS = 1_000_000


class Round:
    """What a sender needs of a server: its line, and rounds of a millisecond."""

    def __init__(self, twin: Twin) -> None:
        self.twin, self.endpoints, self.listening = twin, (), True
        self.pacer = SimpleNamespace(paused=False, speed=1.0)
        self.sender = Sender(self, twin)

    def receive(self, _: Sender, data: bytes) -> None:
        self.twin.write(data)

    def pass_ms(self, ms: int) -> None:
        self.twin.run_until(self.twin.time_ns + ms * MS)
        if data := self.twin.read():
            self.sender.send(data)

    def until(self, *states: str) -> None:
        for _ in range(20_000):
            self.sender.advance()
            if self.sender.state in states:
                return
            self.pass_ms(1)
        raise AssertionError(f"{self.sender.state}, not {states}")


def ready(controller: str) -> tuple[Round, list]:
    twin = Twin(
        controller=controller,
        machine="4030-servo" if controller == "bwo900" else "4030",
        plant="kinematic",
    )
    for data in twin.language.reference():
        twin.write(data)
        assert twin.run_until_idle()
        twin.read()
    return Round(twin), parse_job(HELD[controller], twin.language, controller)


@pytest.mark.parametrize("controller", HELD)
@pytest.mark.parametrize("round_ms", [23, 61, 400])
def test_a_job_held_again_and_again_makes_the_whole_way(controller: str, round_ms: int) -> None:
    """From the first moment at which it can be held, when the sender has not looked since its program was transferred:
    rounds of a busy computer are long. What is paused stands still, and ends at 50 mm."""
    here, lines = ready(controller)
    sender, twin = here.sender, here.twin
    sender.begin(lines)
    places = set()
    while sender.active:
        here.pass_ms(round_ms)
        if sender.hold() == "":
            here.until("paused", "done")
        if sender.state == "paused":
            stood = twin.counts.copy()
            here.pass_ms(500)
            assert (twin.counts == stood).all()
            places.add(int(stood[0]))
            sender.go_on()
    assert sender.state == "done", sender.why
    assert round(float(twin.counts[0] * twin.step_mm[0]), 6) == 50.0
    assert len(places) > 3


def test_a_job_held_before_its_first_line_is_sent_stops_behind_that_line() -> None:
    """While time is paused nothing has been sent that could be held."""
    here, _ = ready("imc-s8")
    sender, twin = here.sender, here.twin
    here.pacer.paused = True
    sender.begin(parse_job(f"{HELD['imc-s8']}@0P\n", twin.language, "imc-s8"))
    assert sender.hold() == ""
    assert (sender.state, twin.idle, twin.commands_due) == ("running", True, False)
    here.pacer.paused = False
    here.until("paused", "done")
    assert (sender.state, sender.index, twin.counts[0] * twin.step_mm[0]) == ("paused", 1, 50.0)
    sender.go_on()
    here.until("done")


def test_stop_forgets_the_vectors_that_are_stored() -> None:
    """An iSMIF has three of them when its job begins. Stopped in the first one, X ends short of it, and the second one,
    which it begins by itself, is broken off within a few rounds: far from its end, and the third is not made."""
    here, _ = ready("ismif")
    lines = parse_job("L1,X3000\nL2,Y3000\nL3,X-3000<1>\n", here.twin.language, "ismif")
    here.sender.begin(lines)
    while here.twin.counts[0] < 500:
        here.sender.advance()
        here.pass_ms(1)
    here.sender.stop("by hand")
    for _ in range(10_000):
        here.sender.advance()
        here.pass_ms(1)
    x, y = here.twin.counts[:2].tolist()
    assert here.twin.idle
    assert here.sender.wait_s is None
    assert 500 < x < 2000
    assert y < 500
