"""Reply codes (manual section 5) and the exception that carries one out of a handler."""

from __future__ import annotations

from isel_twin.firmware.activity import Unfinished

OK = "0"
BAD_NUMBER = "1"
LIMIT_SWITCH = "2"
BAD_AXES = "3"
NO_AXES = "4"
SYNTAX = "5"
MEMORY_FULL = "6"
PARAMETER_COUNT = "7"
NOT_STORABLE = "8"
FAULT = "9"
BAD_SPEED = "D"
STOPPED = "F"
INVALID_FIELD = "G"
HOOD_OPEN = "H"
NOT_REFERENCED = "R"

ALL = frozenset("0123456789DFGHR")
"""Every code this family of controllers uses; A, B, C and E belong to other controllers."""


class Refusal(Unfinished):
    """A command is not carried out, or its activity ends early; `code` is the reply."""

    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.code = code
