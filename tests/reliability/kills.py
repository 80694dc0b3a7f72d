"""The server is killed 200 times while it writes its flash: nothing is torn, and nothing that was acknowledged is lost.

A host stores one number after the other and notes the last one that was answered. After the kill the file holds that
number or a later one, and the next server starts from it, on the same link.
"""

from __future__ import annotations

import os
import random
import re
import tempfile
import threading
import time
from pathlib import Path

import serial

from isel_twin.firmware.imc.settings import decode
from tests.reliability.figures import Figure, ask, main, serving

NUMBER = 200
LONGEST_S = 0.05
"""The kill comes within this time after the first store of a round."""


def stored(file: Path) -> int | None:
    """The number in the flash file; None if it is torn."""
    flash = decode(file.read_bytes())
    return int(flash.settings.user_info) if flash is not None else None


def round_of(file: Path, link: Path, number: int, delay_s: float) -> tuple[int, int]:
    """Store number, number + 1, ... until the server is killed; return the last one acknowledged and the last sent."""
    acknowledged = sent = number - 1
    with serving("--pty", str(link), "--flash", str(file)) as served, served.open("pty") as port:
        info = ask(port, "@0U") and port.read_until(b"\n").decode()
        if number > 1 and (found := re.search(r"\d+", info)) and int(found[0]) < number - 1:
            raise RuntimeError(f"the server begins with {info!r}, but {number - 1} was acknowledged")
        killer = threading.Timer(delay_s, served.process.kill)
        killer.start()
        try:
            while True:
                sent = acknowledged + 1
                if ask(port, f"@0IU{sent}") != "0" or ask(port, "@0IW") != "0":
                    raise RuntimeError("a store was refused")
                acknowledged = sent
        except (serial.SerialException, OSError):
            pass  # the device has gone with the server
        finally:
            killer.join()
    return acknowledged, sent


def measure(number: int) -> list[Figure]:
    chance = random.Random(0)
    torn = lost = stores = 0
    with tempfile.TemporaryDirectory() as folder:
        file, link = Path(folder, "imc.flash"), Path(folder, "imc")
        last = 0
        began = time.monotonic()
        for _ in range(number):
            acknowledged, sent = round_of(file, link, last + 1, chance.uniform(0.0, LONGEST_S))
            found = stored(file) if file.stat().st_size else 0
            torn += found is None
            lost += found is not None and not acknowledged <= found <= sent
            stores += acknowledged - last
            last = sent if found is None else found  # 0: killed before anything was stored
        took_s = time.monotonic() - began
        with serving("--pty", str(link), "--flash", str(file)):
            litter = len(os.listdir(folder)) - 4  # file, link, and the locks of both
    return [
        Figure(f"flash files torn by {number} kills within {stores} stores ({took_s:.0f} s)", torn, "", 0),
        Figure("acknowledged stores lost", lost, "", 0),
        Figure("files left over beside those in use", litter, "", 0),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
