"""Why a line was refused, in words: what its reply means, and what happened to the machine before it.

reply 9, E-stop pressed meanwhile  --->  "plant fault ...; meanwhile, at 1.200 s: set estop pressed"
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from isel_twin.base.units import SECOND_NS
from isel_twin.language import create_language

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

LONG_S = 60.0  # a controller at which nothing moves for longer waits for something
RESTARTED = "the controller restarted before this was done"


def referenced_astray(axes: Iterable[str]) -> str:
    """Words for reference points without a switch (jobs/14); "" for no axes."""
    names = ", ".join(name.upper() for name in dict.fromkeys(axes))
    return f"referenced though no end switch was struck: {names}" if names else ""


def meaning(twin: Twin, sent: bytes, reply: bytes) -> str:
    """What the controller's language says of a reply; "" without a reply or a language."""
    language = create_language(twin.controller_name) if twin.language is not None and reply else None
    if language is None:
        return ""
    list(language.messages(sent, True))
    messages = list(language.messages(reply, False))
    return messages[-1].explanation.removeprefix("reply: ") if messages else ""


def happened(twin: Twin, begin_ns: int) -> str:
    """The last event during a line that began at begin_ns, or before it; "" if there was none."""
    if not twin.acts:
        return ""
    time_ns, words = twin.acts[-1]
    return f"{'meanwhile' if time_ns >= begin_ns else 'before'}, at {time_ns / SECOND_NS:.3f} s: {words}"


def waits(twin: Twin, timeout_s: float) -> str:
    """Of a line that is not over in time: since when nothing has moved; "" if something has, or the time was short."""
    moved_ns = int(twin.steps.t_ns[-1]) if len(twin.steps.t_ns) else 0
    if timeout_s < LONG_S or twin.time_ns - moved_ns < LONG_S * SECOND_NS:
        return ""
    since = f"no complete reply within {timeout_s:g} s, and nothing has moved since {moved_ns / SECOND_NS:.3f} s"
    return f"{since}: the controller waits for an input or for more bytes"
