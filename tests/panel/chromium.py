"""Where browsers for tests are: on the path, or playwright's own Chromium; as a program, sees to it that there are any.

It never fails: where none can be had, the tests that need one are skipped and say so.
"""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import subprocess
import sys
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)

INSTALL_S = 600.0
"""Longest wait for one to be installed."""


MISSING = "there is no Chromium or Chrome; `make browser` installs one"


@functools.cache
def find_browser() -> str | None:
    """Path of Chromium or Chrome; None if there is none. Looking takes half a second of a processor where none is on
    the path, so that no test asks when it is collected."""
    for name in NAMES:
        if found := shutil.which(name):
            return found
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        own = playwright.chromium.executable_path
    return own if Path(own).exists() else None


def find_firefox() -> str | None:
    """Path of Firefox; None if there is none."""
    return next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), None)


def provide() -> None:
    """See that both are there: playwright's Chromium if it can be downloaded, else, as root, those of the system."""
    apt = ["apt-get", "install", "-qq", "--yes", "--no-install-recommends", "chromium", "firefox-esr"]
    ways = [[sys.executable, "-m", "playwright", "install", "chromium"]]
    if shutil.which("apt-get") and os.geteuid() == 0:
        ways += [["apt-get", "update", "-qq"], apt]
    for way in ways:
        find_browser.cache_clear()
        if find_browser() is not None and find_firefox() is not None:
            return
        print(f"trying: {' '.join(way)}", file=sys.stderr)
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            subprocess.run(way, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=INSTALL_S, check=False)


if __name__ == "__main__":
    provide()
    find_browser.cache_clear()
    print(f"browser for tests: {find_browser() or 'none, they will be skipped'}", file=sys.stderr)
