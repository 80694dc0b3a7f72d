"""10 000 clients, one after the other, on a server whose standard error nobody reads."""

from __future__ import annotations

import os
import socket

from tests.reliability.figures import REPLY_S, Figure, growth_mb, main, serving

NUMBER = 10_000
WARM = 100
GROWTH_MB = 5.0


def unanswered(address: tuple[str, int], number: int) -> int:
    """Connect, ask, hang up, so often; return how many got no right answer."""
    wrong = 0
    for _ in range(number):
        with socket.create_connection(address, REPLY_S) as client:
            client.sendall(b"@0P\r")
            reply = b""
            while len(reply) < 19 and (piece := client.recv(19)):
                reply += piece
            wrong += reply != b"0" * 19
    return wrong


def measure(number: int) -> list[Figure]:
    with serving("--tcp", "127.0.0.1:0") as served:
        host, port = served.info["tcp"].split(":")
        address = host, int(port)
        wrong = unanswered(address, WARM)
        files = len(os.listdir(f"/proc/{served.pid}/fd"))

        def work() -> None:
            nonlocal wrong
            wrong += unanswered(address, number)

        grown = growth_mb(served.pid, work)
        files = len(os.listdir(f"/proc/{served.pid}/fd")) - files
    return [
        Figure(f"clients of {number} that got no right answer", wrong, "", 0),
        Figure("growth", grown, "MB", GROWTH_MB),
        Figure("open files more than before", files, "", 1),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
