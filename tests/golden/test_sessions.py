"""Same bytes in, same bits out: sessions have the digests on file. `make thorough` plays all of the golden ones."""

from __future__ import annotations

import pytest
from golden.digest import LENGTH, REMEDY, load, save
from golden.sessions import FILE, chunks, digest_of, names, session

from isel_twin.controller import controller_names
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=8)

KEPT = load(FILE)
CHUNKS = chunks()
SEEN: dict[str, str] = {}


@pytest.mark.parametrize("chunk", CHUNKS)
def test_sessions_are_those_on_file(chunk: str, update_golden: bool) -> None:
    sessions = CHUNKS[chunk]
    if not update_golden and not chunk.startswith("fixed"):
        sessions = sessions[:: len(sessions) // drawn(len(sessions))]
    seen = {name: digest_of(session(name)) for name in sessions}
    raised = {name: value for name, value in seen.items() if len(value) != LENGTH}
    assert not raised, raised
    if update_golden:
        SEEN.update(seen)
        save(FILE, {name: value for name, value in {**load(FILE), **SEEN}.items() if name in names()})
        return
    new = [name for name in seen if name not in KEPT]
    assert not new, f"new sessions: {', '.join(new)}; run make golden"
    differ = [name for name, value in seen.items() if value != KEPT[name]]
    assert not differ, (
        f"golden: {len(differ)} of {len(seen)} sessions differ: {', '.join(differ)}\n"
        f"to look at one, here and on the code before: python -m tests.golden.sessions '{differ[0]}'; {REMEDY}"
    )


def test_every_session_on_file_is_made(update_golden: bool) -> None:
    assert update_golden or sorted(KEPT) == sorted(names())


def test_every_installed_controller_has_sessions() -> None:
    assert set(controller_names()) == {name.split("/")[0] for name in names()} - {"fixed"}
