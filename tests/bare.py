"""Runs `isel-twin` as on a computer without what only POSIX has: python tests/bare.py serve --tcp 127.0.0.1:0

Other people's packages have their own ways on Windows; as this is none, they are imported first. From then on nobody
can import the modules of MODULES, and the functions and constants of NAMES are not there, as in Python for Windows.
"""

from __future__ import annotations

import importlib.abc
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

import mujoco
import numpy
import serial.rfc2217
import serial.tools.list_ports

OTHERS = (mujoco, numpy, serial, subprocess)

MODULES = ("fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty")
NAMES: dict[ModuleType, tuple[str, ...]] = {
    os: (
        *("O_CLOEXEC", "O_DIRECTORY", "O_NOCTTY", "O_NONBLOCK", "WNOHANG", "chown", "fchmod", "fork", "forkpty"),
        *("geteuid", "getpgid", "getuid", "killpg", "mkfifo", "openpty", "setsid", "statvfs", "sysconf", "ttyname"),
        *("set_blocking", "get_blocking", "pread", "pwrite", "sched_getaffinity", "sched_setaffinity"),
    ),
    select: ("epoll", "poll", "POLLRDHUP", "POLLIN"),
    signal: ("SIGHUP", "SIGALRM", "SIGUSR1", "SIGKILL", "pthread_sigmask", "setitimer"),
    socket: ("TCP_USER_TIMEOUT",),
}


class _Absent(importlib.abc.MetaPathFinder):
    """Refuses the modules."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname in MODULES:
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)
        return None


def hide() -> None:
    """From now on, in this process."""
    import selectors

    for module in MODULES:
        sys.modules.pop(module, None)
    sys.meta_path.insert(0, _Absent())
    for place, names in NAMES.items():
        for name in names:
            if hasattr(place, name):
                delattr(place, name)
    selectors.DefaultSelector = selectors.SelectSelector  # type: ignore[misc,assignment]


if __name__ == "__main__":
    hide()
    from isel_twin.cli import main

    main()
