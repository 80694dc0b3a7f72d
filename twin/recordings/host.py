"""Plays the host of a recording to a twin, as it was when a real controller answered it.

What was sent after a reply is sent after that reply, as much later as then: replies come when the twin gives them. A
reply that differs does not end it: it goes on when as many replies have come as then, or none will come any more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from isel_twin.base.units import SECOND_NS
from isel_twin.core.journal import Received
from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed
from isel_twin.recordings.compare import Exchange, paired
from isel_twin.recordings.replay import SLICE_NS, Pace, run_until

PATIENCE_S = 3600.0  # virtual seconds to wait for a reply that the real controller gave
Piece = tuple[int, bytes, bool, int]  # of `compare.traffic`


def play_host(pieces: Sequence[Piece], twin: Twin, pace: Pace | None = None) -> list[Exchange]:
    """Play the host in these pieces of traffic; return the commands with the twin's replies.

    Raises LanguageError for a controller without a language.
    """
    name = twin.controller_name
    then, now = (needed(create_language(name), name) for _ in range(2))
    counted = {"then": 0, "now": 0}
    heard: list[Piece] = []

    def note(time_ns: int, kind: str, what: Any) -> None:
        if kind == "sent":
            heard.append((time_ns, what, True, 0))
            list(now.messages(what, True))
        elif kind == "received":
            received: Received = what
            heard.append((received.arrival_ns, received.data, False, received.byte_ns))

    def answered() -> bool:
        counted["now"] += sum(1 for _ in now.messages(twin.read(), False))
        return counted["now"] >= counted["then"]

    twin.listen(note)
    last_ns = pieces[0][0] if pieces else 0
    for time_ns, data, by_host, _ in pieces:
        messages = list(then.messages(data, by_host))
        if not by_host:
            counted["then"] += len(messages)
            last_ns = time_ns
            continue
        _await(twin, answered, pace)
        run_until(twin, twin.time_ns + max(0, time_ns - last_ns), pace, lambda: False)
        last_ns = time_ns
        twin.write(data)
    _await(twin, lambda: answered() and False, pace)
    language = needed(create_language(name), name)
    return paired(sorted(heard, key=lambda piece: piece[0]), language)


def _await(twin: Twin, answered: Any, pace: Pace | None) -> None:
    """Let time pass until the twin has answered as much as the controller had at that point, or is idle."""
    end_ns = twin.time_ns + round(PATIENCE_S * SECOND_NS)
    while not answered() and twin.time_ns < end_ns and not twin.idle:
        if pace is None:
            twin.run_until(end_ns, lambda: twin.reply_waiting or twin.idle)
        else:
            run_until(twin, twin.time_ns + SLICE_NS, pace, lambda: twin.reply_waiting or twin.idle)
    answered()
