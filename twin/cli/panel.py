"""`isel-twin panel`: a recording in a browser, or as one page to hand on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options

ADDRESS = "127.0.0.1:8217"  # as that of a served machine


def panel(
    recording: Annotated[Path, Parameter(help="File that --record NAME.mcap has made.")],
    /,
    *,
    html: Annotated[
        Path | None,
        options.written("Write the page here, to be handed on, instead of serving it.", *options.PAGE, bare=True),
    ] = None,
    most: Annotated[float, Parameter(help="Of --html: largest file, in MB; what does not fit is left out.")] = 5.0,
    address: Annotated[str, Parameter(help="HOST:PORT where browsers find the page; port 0: a free one.")] = ADDRESS,
    token_file: Annotated[
        Path | None, Parameter(help="Holds what browsers have to know; beyond the loopback interface one is made up.")
    ] = None,
    json: options.Json = False,
) -> int:
    """Walk a recording back and forth in a browser: machine in 3D, serial line, and a scope on one time axis.

    The scope has steps and directions, levels, states, margins, forces; zoom, two cursors, a trigger, and saves what it
    shows as VCD. Prints one line of JSON with the address, and serves the page until it is told to stop (Ctrl-C).

    With --html the page is a file, which needs no network and nobody but a browser. It holds each sample and each step
    as far as they fit; it says what was left out.
    """
    from isel_twin.base.files import atomic_write
    from isel_twin.bridge.operate.panel.recorded import SHOWN_BYTES, RecordedSite
    from isel_twin.cli.outputs import say, say_json
    from isel_twin.recordings.reading import read
    from isel_twin.report.playback import playback_page

    if not most > 0:
        raise CallError(f"most: {most:g} MB; allowed: more than 0", option=True)
    if html is not None and (address != ADDRESS or token_file is not None):
        raise CallError("html: writes a file and serves nothing; leave out --address and --token-file", option=True)
    options.check_writable(html, kept=(recording, token_file))
    token = options.token(token_file)
    with call_errors(recording):
        recorded = read(recording)
        page, left_out = playback_page(recorded, SHOWN_BYTES if html is None else int(most * 1e6))
    if not recorded.whole:
        say(f"{recording}: has no end, it was cut off; the page has what there is")
    for what in left_out:
        say(f"{recording}: left out of the page: {what}")
    if html is not None:
        with call_errors(html):
            atomic_write(html, page.encode())
        if json:
            told = {"recording": str(recording), "html": str(html), "bytes": len(page.encode())}
            say_json({**told, "whole": recorded.whole, "left_out": left_out})
        else:
            print(f"{html}: {len(page.encode()) / 1e6:.1f} MB; plays by itself in a browser")
        return 0
    with call_errors():
        site = RecordedSite(address, page, token)
    with site:
        say_json({"panel": site.url, "recording": str(recording)})
        site.serve_forever()
    return 0
