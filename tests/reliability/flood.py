"""A host that asks without a pause at speed 20 for a minute: the server neither grows nor forgets to answer."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress

from tests.reliability.figures import REPLY_S, Figure, main, resident_mb, serving

NUMBER = 60
GROWTH_MB = 5.0
LINE_BYTES_PER_S = 20 * 1920
"""What the line carries at speed 20."""


def measure(number: int) -> list[Figure]:
    with serving("--tcp", "127.0.0.1:0", speed="20") as served:
        host, port = served.info["tcp"].split(":")
        with socket.create_connection((host, int(port)), REPLY_S) as client:
            end = threading.Event()
            got = bytearray()

            def read() -> None:
                while piece := client.recv(65_536):
                    got.extend(piece)

            def write() -> None:
                with suppress(OSError):  # hung up in the midst of it
                    while not end.is_set():
                        client.sendall(b"@0P\r" * 1000)

            reader, writer = threading.Thread(target=read), threading.Thread(target=write, daemon=True)
            reader.start()
            writer.start()
            time.sleep(5.0)
            before_mb, before = resident_mb(served.pid), len(got)
            began = time.monotonic()
            time.sleep(number)
            grown = max(0.0, resident_mb(served.pid) - before_mb)
            rate = (len(got) - before) / (time.monotonic() - began)
            end.set()
            client.shutdown(socket.SHUT_RDWR)
            reader.join()
            writer.join()
        wrong = got.strip(b"0") != b""
    return [
        Figure(f"growth while a host floods for {number} s at speed 20", grown, "MB", GROWTH_MB),
        Figure("reply bytes that are wrong", float(wrong), "", 0),
        Figure("what the line could carry over what it did", LINE_BYTES_PER_S / max(rate, 1.0), "", 1.2),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
