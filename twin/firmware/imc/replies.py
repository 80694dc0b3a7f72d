"""Reply codes (manual section 5) and the exception that carries one out of a handler."""

from __future__ import annotations

from collections.abc import Mapping

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

# every code of this family in words; A, B, C and E belong to other controllers
WORDS: Mapping[str, str] = {
    OK: "done",
    BAD_NUMBER: "not a number, or out of range",
    LIMIT_SWITCH: "limit switch struck, or none found",
    BAD_AXES: "axes that are not set, or may not be named together",
    NO_AXES: "axes have not been set",
    SYNTAX: "no such command",
    MEMORY_FULL: "program memory full",
    PARAMETER_COUNT: "wrong number of parameters",
    NOT_STORABLE: "cannot be stored",
    FAULT: "safety chain open, or not initialised since",
    BAD_SPEED: "speed out of range",
    STOPPED: "stopped or broken off",
    INVALID_FIELD: "nothing to start, or program memory not empty",
    HOOD_OPEN: "hood open in automatic",
    NOT_REFERENCED: "not referenced",
}


# a command answered so is right, and the machine's state is in its way
HINDERED = frozenset({LIMIT_SWITCH, FAULT, STOPPED, HOOD_OPEN, NOT_REFERENCED})


class Refusal(Unfinished):
    """A command is not carried out, or its activity ends early; `code` is the reply."""

    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.code = code
