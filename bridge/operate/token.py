"""Access to operating a machine: free on the loopback interface; elsewhere with a token (bridge/8)."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from typing import Any

from isel_twin.bridge.serve.tcp import parse_address


def is_loopback(address: str) -> bool:
    """True if only this computer can reach the address HOST:PORT; the host is a number."""
    return ipaddress.ip_address(parse_address(address)[0].partition("%")[0]).is_loopback


def token_for(address: str, given: str | None) -> str | None:
    """The token needed at an address: the given one, else none on loopback, else a random one."""
    return given or (None if is_loopback(address) else secrets.token_hex(16))


def is_token(given: Any, token: str | None) -> bool:
    """True if `given`, which may be anything, is the token, or none is needed. Constant time."""
    return token is None or (
        isinstance(given, str) and hmac.compare_digest(given.encode("utf-8", "surrogatepass"), token.encode("utf-8"))
    )
