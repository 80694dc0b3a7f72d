"""Sessions as host programs in the field hold them, byte by byte."""

from __future__ import annotations

import pytest

from isel_twin.testing import Desk

SESSIONS = {
    "set up, 3D, absolute move": [
        ("@07", "0"),
        ("@0d2000,2000,2000", "0"),
        ("@0R7", "0"),
        ("@0z1", "0"),
        ("@0J159", "0"),
        ("@0M15992,3198,6397,3198,1119,3198,0,3198", "0"),
        ("@0P", "0" + "003E78" + "0018FD" + "00045F"),
    ],
    "ports, a malformed port, an arc and back to where it began": [
        ("@07\r@0R7", "00"),
        ("@0M5000,5000,5000,5000,0,900,0,30", "0"),
        ("@0B1,0\r@0B2,1\r@0B3,1", "000"),
        ("@0B,64", "1"),
        ("@0f0", "0"),
        ("@0y 2400,400,-200,0,-400,-1,1", "0"),
        ("@0M5000,5000,5000,5000,0,900,0,30", "0"),
        ("@0P", "0" + "001388" * 2 + "000000"),
    ],
    "flash values, reference direction inverted: the whole travel is negative": [
        ("@0IX", "0"),
        ("@0IR7", "0"),
        ("@0IW", "0"),
        ("@07", "0"),
        ("@0d3000,3000,3000", "0"),
        ("@0R7", "0"),
        ("@0A -800,5000,-1600,5000,-160,5000,0,100", "0"),
        ("@0P", "0" + "FFFCE0" + "FFF9C0" + "FFFF60"),
    ],
    "a stored program, each line acknowledged": [
        ("@03", "0"),
        ("@0R3", "0"),
        ("@0j300", "0"),
        ("@0J100", "0"),
        ("@0k", "0"),
        ("@0i", "0"),
        ("0 500,5000,300,5000", "0"),
        ("3 3,-1", "0"),
        ("9", "0"),
        ("@0S", "0"),
        ("@0P", "0" + "0007D0" + "0004B0" + "000000"),
    ],
    "small letters, single axes one after the other, decimals": [
        ("@07", "0"),
        ("@0r4", "0"),
        ("@0r2", "0"),
        ("@0r1", "0"),
        ("@0a 8666.666666666668,6000.0,-0.5,5000,666.67,5000,-666.67,900", "0"),
        ("@0m8666,5000,0,5000,0,5000,0,1000", "0"),
        ("@0p", "0" + "0021DA" + "000000" * 2),
        ("@0s", "G"),
    ],
    "a move refused, initialised and referenced on that, and sent again": [
        ("@07", "0"),
        ("@0M0,900,0,900,0,900,0,30", "0"),
        ("@0M500,900,0,900,0,900,0,30", "R"),
        ("@07", "0"),
        ("@0R7", "0"),
        ("@0M500,900,0,900,0,900,0,30", "0"),
        ("@07", "0"),
        ("@0P", "0" + "0001F4" + "000000" * 2),
        ("@0M600,900,0,900,0,900,0,30", "0"),
    ],
    "a limit switch, answered with a reference run": [
        ("@07", "0"),
        ("@0R7", "0"),
        ("@0A-5000,5000,0,900,0,900,0,30", "2"),
        ("@0A100,5000,0,900,0,900,0,30", "2"),
        ("@0R7", "2"),
        ("@07", "0"),
        ("@0R7", "0"),
        ("@0A100,5000,0,900,0,900,0,30", "0"),
        ("@0P", "0" + "000064" + "000000" * 2),
    ],
}


@pytest.mark.parametrize("ending", ["\r", "\r\n", "\n\r"], ids=["CR", "CR-LF", "LF-CR"])
@pytest.mark.parametrize("session", SESSIONS.values(), ids=SESSIONS.keys())
def test_session(session: list[tuple[str, str]], ending: str) -> None:
    """Every byte takes its time at 19200 baud."""
    desk = Desk.of("imc-s8")
    for text, reply in session:
        desk.send("".join(line + ending for line in text.split("\r")).encode("ascii"), byte_time_ns=520_833)
        assert desk.finish() == reply, text
