"""A client whose cable is pulled in mid-session gives up the line within a minute.

The client lives in a network namespace of its own (Linux, root, `ip`), joined to us by a pair of virtual cards; its end
is switched off. From then on somebody else asks for the line once a second.

    server 10.213.0.1:PORT  [veth] ------x------ [veth]  client 10.213.0.2
       ^--- 127.0.0.1: "may I?" ... "in use" ... "in use" ... and at last an answer
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time

from tests.reliability.figures import REPLY_S, Figure, main, serving

NUMBER = 1
LIMIT_S = 60.0
PATIENCE_S = 180.0

CLIENT = """
import socket, sys, time
with socket.create_connection((sys.argv[1], int(sys.argv[2])), 30) as client:
    client.sendall(b"@0P\\r")
    got = b""
    while len(got) < 19:
        got += client.recv(19)
    print("connected", flush=True)
    time.sleep(3600)
"""


def run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def seconds_until_free() -> float:
    """Pull the cable of a client; time until the line is free."""
    name = f"isel{os.getpid()}"
    ours, theirs = f"{name}a"[-15:], f"{name}b"[-15:]
    run("ip", "netns", "add", name)
    client = None
    try:
        run("ip", "link", "add", ours, "type", "veth", "peer", "name", theirs, "netns", name)
        run("ip", "addr", "add", "10.213.0.1/30", "dev", ours)
        run("ip", "link", "set", ours, "up")
        run("ip", "-n", name, "addr", "add", "10.213.0.2/30", "dev", theirs)
        run("ip", "-n", name, "link", "set", theirs, "up")
        with serving("--pty", "--tcp", "0.0.0.0:0") as served:
            port = served.info["tcp"].rpartition(":")[2]
            client = subprocess.Popen(
                ["ip", "netns", "exec", name, sys.executable, "-c", CLIENT, "10.213.0.1", port],
                stdout=subprocess.PIPE,
                text=True,
            )
            assert client.stdout is not None
            if client.stdout.readline() != "connected\n":
                raise RuntimeError("the client could not connect")
            run("ip", "-n", name, "link", "set", theirs, "down")
            began = time.monotonic()
            while time.monotonic() - began < PATIENCE_S:
                with socket.create_connection(("127.0.0.1", int(port)), REPLY_S) as other:
                    other.sendall(b"@0P\r")
                    if other.recv(1) == b"0":
                        return time.monotonic() - began
                time.sleep(1.0)
        return PATIENCE_S
    finally:
        if client is not None:
            client.kill()
            client.wait()
        run("ip", "netns", "delete", name)


def measure(number: int) -> list[Figure]:
    if not hasattr(os, "geteuid") or os.geteuid() != 0 or shutil.which("ip") is None:
        print("vanished: not measured here, it needs root and `ip`", file=sys.stderr)
        return []
    slowest = max(seconds_until_free() for _ in range(number))
    return [Figure("a client whose cable was pulled holds the line for", slowest, "s", LIMIT_S)]


if __name__ == "__main__":
    main(measure, NUMBER)
