"""Commands that the iMC does not have, found in its tables: teaching it one needs no edit of the tests of code `5`.

DNC        "@0" and a letter of which no command and no alias begins
INITIAL    "@0I" and a letter of which no initialisation value begins
CNC        one character that begins no storable command
"""

from __future__ import annotations

from string import ascii_letters, digits

from isel_twin.firmware.imc import commands
from isel_twin.firmware.imc.wording import FLOW

_dnc = {*commands.DNC, *commands.DNC_ALIASES, *FLOW, "I"}
_cnc = {*commands.CNC, *commands.CNC_ALIASES, "9"}

DNC = tuple(f"@0{letter}" for letter in reversed(ascii_letters) if letter not in _dnc)
INITIAL = tuple(f"@0I{letter}" for letter in ascii_letters if f"I{letter}" not in commands.INITIALISATION)
CNC = tuple(code for code in ascii_letters + digits if code not in _cnc)
