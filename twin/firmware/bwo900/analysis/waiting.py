"""What the interpreter waits for, and what it renews after a block has been executed."""

from __future__ import annotations

from enum import Enum


class Waiting(Enum):
    """What analysis waits for."""

    EXECUTION = "the last block, to be executed"
    CONDITION = "the parameters that waituntil asks for"
    ACKNOWLEDGEMENT = "the M function with a jump"
    BEGINNING = "the path of the last block, to begin (sc:2)"
    FEED = "the next block of a program that is fed"
    PASS = "the next pass: a block of supervision (sc:1) has been analysed"


class Renewal(Enum):
    """What to renew, beside the coordinates, after the awaited block has been executed."""

    NOTHING = "nothing"
    MEASURED = "the tool's length, which M00 lets a person measure"
    LENGTH = "the tool's length: Z6 has come to its end"
    TOOL = "the tool and its length: M06"
