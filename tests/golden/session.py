"""A session: how a twin is built and what is done to it, as data; and what it did.

Only the public contract of `isel_twin.Twin` is used, so that sessions outlive whatever is behind it. Actions are

    ("write", b"...")            the host sends bytes
    ("run", seconds, slices)     time passes in so many pieces, the host reads after each
    ("ask", b"...", limit_s)     the host sends bytes and reads until the answer is complete, at most so long
    ("set", name, state)         something is operated
    ("sample", interval_s)       from now on samples are taken, and are part of what it did

and after each the host reads.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from golden.digest import digest, switches_full_steps
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.core.sampling import TwinSamples

Action = tuple[Any, ...]

ASK_SLICE_S = 0.05
LAST_RUN_S = 0.5


@dataclass(frozen=True)
class Session:
    """Keyword arguments of the twin, what is done to it, and the text of a scenario file."""

    options: Mapping[str, Any]
    actions: tuple[Action, ...]
    scenario: str | None = None

    @property
    def coarse(self) -> bool:
        """An iSMIF was told to make full steps; see `digest`."""
        sent = b"".join(action[1] for action in self.actions if action[0] in ("write", "ask"))
        return self.options["controller"] == "ismif" and switches_full_steps(sent)


@dataclass(frozen=True)
class Played:
    """What a session did: replies with the times at which they were read, the stream, and where everything ended."""

    replies: list[tuple[int, bytes]]
    steps: Any
    counts: NDArray[np.int64]
    position_mm: NDArray[np.float64]
    samples: tuple[NDArray[np.float64], ...] = ()  # flat, in the order in which they came


def play(session: Session, detour: Callable[[Twin], Twin] | None = None) -> Played:
    """Build the twin and do everything.

    detour: called before each action with the twin, and returns the one with which to go on.
    """
    twin = build(session)
    replies: list[tuple[int, bytes]] = []
    samples: list[NDArray[np.float64]] = []

    def take(taken: TwinSamples) -> None:
        samples.extend(np.asarray(getattr(taken, each.name), np.float64).ravel() for each in fields(taken))

    def read() -> bytes:
        data = twin.read()
        if data:
            replies.append((twin.time_ns, data))
        return data

    for kind, *values in session.actions:
        if detour is not None:
            twin = detour(twin)
        match kind:
            case "write":
                twin.write(*values)
            case "set":
                twin.set_input(*values)
            case "sample":
                assert twin.sample(take, round(values[0] * 1e9)) is not None
            case "run":
                seconds, slices = values
                for _ in range(slices):
                    if detour is not None and slices > 1:
                        twin = detour(twin)
                    twin.run(seconds / slices)
                    read()
            case "ask":
                data, limit_s = values
                end = b"\x02\r" if b"\x01" in data else b""
                twin.write(data)
                answer = read()
                for _ in range(round(limit_s / ASK_SLICE_S)):
                    if answer and answer.endswith(end):
                        break
                    twin.run(ASK_SLICE_S)
                    answer += read()
            case _:
                raise ValueError(f"unknown action {kind!r}")
        read()
    twin.run(LAST_RUN_S)
    read()
    twin.sample_no_more(take)
    return Played(replies, twin.steps, twin.counts, twin.position_mm, tuple(samples))


def build(session: Session, **changes: Any) -> Twin:
    """The twin of a session, with other options."""
    options = {**session.options, **changes}
    if session.scenario is None:
        return Twin(**options)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.toml"
        path.write_text(session.scenario, encoding="utf-8")
        return Twin(**options, scenario=path)


def digest_of(session: Session, detour: Callable[[Twin], Twin] | None = None) -> str:
    """Play a session and digest what it did; if the twin raises an exception, say which. detour: see `play`."""
    try:
        played = play(session, detour)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    physics = session.options["plant"] == "mujoco"
    positions = None if session.coarse and physics else np.concatenate((played.position_mm, *played.samples))
    return digest(played.replies, played.steps, played.counts, positions, session.coarse)
