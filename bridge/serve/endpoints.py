"""Opens endpoints: any number of pseudo terminals, TCP and RFC 2217 ports; imported on demand."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from isel_twin.base.errors import CallError, call_errors
from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.tcp import TcpEndpoint


def open_endpoints(
    ptys: Sequence[str] | None, tcps: Sequence[str] | None, rfc2217s: Sequence[str] | None, stack: ExitStack
) -> list[Endpoint]:
    """Listen, by default at a pseudo terminal, before the rest of the start. Raises CallError for a port in use."""
    endpoints: list[Endpoint] = []
    with call_errors():
        for link in ptys or ([] if tcps or rfc2217s else [""]):
            try:
                from isel_twin.bridge.serve.pty import PtyEndpoint
            except ImportError:  # Windows
                raise CallError(
                    "pty: this system has no pseudo terminals; name --tcp HOST:PORT or --rfc2217 HOST:PORT", option=True
                ) from None

            endpoints.append(PtyEndpoint(link or None))
            stack.callback(endpoints[-1].close)
        for address in tcps or ():
            endpoints.append(TcpEndpoint(address))
            stack.callback(endpoints[-1].close)
        for address in rfc2217s or ():
            from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec

            endpoints.append(TcpEndpoint(address, "rfc2217", Rfc2217Codec))
            stack.callback(endpoints[-1].close)
    return endpoints


def ports(endpoints: Sequence[Endpoint]) -> list[dict[str, str]]:
    """Each endpoint: kind and address; of a pseudo terminal with a link: the link as address, and its device."""
    found = []
    for endpoint in endpoints:
        if link := getattr(endpoint, "link", None):
            found.append({"kind": endpoint.kind, "address": os.path.abspath(link), "device": endpoint.address})
        else:
            found.append({"kind": endpoint.kind, "address": endpoint.address})
    return found


def addresses(endpoints: Sequence[Endpoint]) -> dict[str, Any]:
    """Addresses for the output of a command: the first of each kind under its name, and all `ports` if there are more.
    pty: the link if there is one; `device`: its target.
    """
    first: dict[str, Any] = {}
    for endpoint in endpoints:
        if endpoint.kind not in first:
            link = getattr(endpoint, "link", None)
            first |= {endpoint.kind: link, "device": endpoint.address} if link else {endpoint.kind: endpoint.address}
    return {**first, "ports": ports(endpoints)} if len(first.keys() - {"device"}) < len(endpoints) else first


def name_of(endpoint: Endpoint) -> str:
    """Its name for hosts: the link of a pseudo terminal if there is one, else the address."""
    return getattr(endpoint, "link", None) or endpoint.address


def claimed(endpoints: Sequence[Endpoint]) -> bool:
    """True if a network client may take the line that these endpoints share; a departing one is disconnected."""
    if any(endpoint.busy for endpoint in endpoints):
        return False
    for endpoint in endpoints:
        endpoint.give_way()
    return True
