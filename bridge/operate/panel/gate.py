"""Access to the panel. A wrong host, a page of another origin or a missing token get 403 and one line with the reason.
On the loopback interface the host must be this computer by name or number, against DNS rebinding. The link that `serve`
prints has the token, and the browser keeps it in a cookie.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from isel_twin.bridge.operate.token import is_loopback, is_token
from isel_twin.bridge.serve.tcp import parse_address


class Gate:
    def __init__(self, address: str, token: str | None) -> None:
        self._token = token
        self._local = is_loopback(address)
        self._cookie = f"panel_{parse_address(address)[1]}"

    def refusal(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Why a request is refused; None: it is allowed. Never raises, whatever the headers."""
        host = headers.get("Host", "")
        if self._local and not _is_this_computer(host):
            return "the host is not this computer"
        origin = headers.get("Origin")
        if origin is not None and origin != f"http://{host}":
            return "the page comes from another origin"
        if headers.get("Sec-Fetch-Site") in ("cross-site", "same-site") and headers.get("Sec-Fetch-Mode") != "navigate":
            return "the page comes from another origin"
        if not (is_token(self.given(path), self._token) or is_token(self._kept(headers), self._token)):
            return "the token is missing; open the link that serve has printed"
        return None

    def given(self, path: str) -> str | None:
        return parse_qs(urlsplit(path).query).get("token", [None])[0]

    def keep(self, path: str) -> str | None:
        """The cookie for a browser with the token."""
        if self._token is None or not is_token(self.given(path), self._token):
            return None
        return f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"

    def _kept(self, headers: Mapping[str, str]) -> str | None:
        try:
            found = SimpleCookie(headers.get("Cookie", "")).get(self._cookie)
        except CookieError:
            return None
        return None if found is None else found.value


def _is_this_computer(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
