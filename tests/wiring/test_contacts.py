"""Contacts to levels: openers, closers, series circuits, bounce, broken wires."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from isel_twin.machine import Contact
from isel_twin.wiring import Contacts
from isel_twin.wiring.cabinet import SIGNALS

BOUNCE_MS = 1.0


TERMINALS = {"p": ("s",)}


def switch(name: str, type_: str = "opener", *, inverted: bool = False, bounce: float = 0.0) -> Contact:
    return Contact(
        name=name,
        kind="switch",
        type=type_,
        inverted=inverted,
        axis="x",
        end="far",
        bounce_ms=bounce,
    )


def contacts(*listed: Contact, terminals: Mapping[str, tuple[str, ...]] = TERMINALS, seed: int = 1) -> Contacts:
    return Contacts(listed, terminals, SIGNALS, np.random.default_rng(seed))


def settle(box: Contacts) -> None:
    while (t := box.next_ns) is not None:
        box.advance(t)


@pytest.mark.parametrize(
    ("type_", "inverted", "free", "struck"),
    [
        ("opener", False, True, False),
        ("opener", True, False, True),
        ("closer", False, False, True),
        ("closer", True, True, False),
    ],
)
def test_level_follows_type_and_wiring(type_: str, inverted: bool, free: bool, struck: bool) -> None:
    box = contacts(switch("s", type_, inverted=inverted))
    assert box.levels() == {"p": free}
    box.strike("s", True, 0)
    assert box.levels() == {"p": struck}
    box.strike("s", False, 10)
    assert box.levels() == {"p": free}


def test_contacts_in_series_read_high_only_while_all_are_closed() -> None:
    box = contacts(switch("a"), switch("b"), terminals={"pin": ("a", "b")})
    assert box.levels() == {"pin": True}
    box.strike("b", True, 0)
    assert box.levels() == {"pin": False}
    box.strike("a", True, 1)
    box.strike("b", False, 2)
    assert box.levels() == {"pin": False}


@pytest.mark.parametrize("seed", range(20))
def test_bounce_changes_at_once_ends_within_its_time_and_ends_in_the_new_state(seed: int) -> None:
    box = contacts(switch("s", bounce=BOUNCE_MS), seed=seed)
    box.strike("s", True, 5_000)
    assert box.levels() == {"p": False}
    changes = 0
    while (t := box.next_ns) is not None:
        assert 5_000 < t <= 5_000 + BOUNCE_MS * 1e6
        changes += box.advance(t)
    assert changes <= 6
    assert box.levels() == {"p": False}


def test_bounces_occur_and_are_seeded() -> None:
    def history(seed: int) -> list[int]:
        box = contacts(switch("s", bounce=BOUNCE_MS), seed=seed)
        times = []
        for n in range(5):
            box.strike("s", n % 2 == 0, n * 10_000_000)
            while (t := box.next_ns) is not None:
                times.append(t)
                box.advance(t)
        return times

    assert history(3)
    assert history(3) == history(3)
    assert history(3) != history(4)


def test_faults_hold_a_contact_until_healed() -> None:
    box = contacts(switch("s"))
    box.set_fault("s", "broken")
    assert box.levels() == {"p": False}
    box.set_fault("s", "stuck_closed")
    box.strike("s", True, 0)
    settle(box)
    assert box.levels() == {"p": True}
    box.set_fault("s", "ok")
    assert box.levels() == {"p": False}


@pytest.mark.parametrize("seed", range(5))
def test_a_worn_contact_chatters_longer_than_any_good_one_and_at_most_20_ms(seed: int) -> None:
    box = contacts(switch("s", bounce=BOUNCE_MS), seed=seed)
    box.set_fault("s", "bounce")
    box.strike("s", True, 5_000)
    box.advance(5_000)
    times = []
    while (t_ns := box.next_ns) is not None:
        times.append(t_ns - 5_000)
        box.advance(t_ns)
    assert 5_000_000 < times[-1] <= 20_000_000
    assert box.levels() == {"p": False}


def test_what_the_machine_lacks_is_left_out() -> None:
    box = contacts(switch("a"), terminals={"both": ("a", "nothing"), "none": ("nothing",)})
    assert box.levels() == {"both": True}
    assert box.names == ("a",)


@pytest.mark.parametrize("seed", range(20))
def test_a_new_change_ends_the_bounces_of_the_one_before(seed: int) -> None:
    """Released a moment after it was struck: what is left of the first chatter would open a contact that is closed."""
    box = contacts(switch("s", bounce=BOUNCE_MS), seed=seed)
    box.strike("s", True, 0)
    first_ns = box.next_ns or 0
    box.strike("s", False, 1)
    times = []
    while (t_ns := box.next_ns) is not None:
        box.advance(t_ns)
        times.append(t_ns)
    assert box.closed("s")
    assert len(times) <= 6
    assert first_ns not in times
