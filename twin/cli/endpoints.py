"""Where hosts connect: the options --pty, --tcp and --rfc2217 of a command, each as often as wanted."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.call import call_errors

if TYPE_CHECKING:
    from isel_twin.bridge.server import Endpoint

__all__ = ["Ptys", "Rfc2217s", "Tcps", "addresses", "open_endpoints"]

Ptys = Annotated[
    list[str] | None,
    Parameter(help="A pseudo terminal, and a link to it if a name is given. The default. May be repeated."),
]
Tcps = Annotated[list[str] | None, Parameter(help="HOST:PORT for raw TCP; port 0: a free one. May be repeated.")]
Rfc2217s = Annotated[
    list[str] | None, Parameter(help="HOST:PORT for RFC 2217 (Telnet with line settings). May be repeated.")
]


def open_endpoints(
    ptys: Sequence[str] | None, tcps: Sequence[str] | None, rfc2217s: Sequence[str] | None, stack: ExitStack
) -> list[Endpoint]:
    """Listen everywhere, so that a taken port is found before anything else. Raises CallError.

    What one gets without a word is a pseudo terminal.
    """
    endpoints: list[Endpoint] = []
    with call_errors():
        for link in ptys or ([] if tcps or rfc2217s else [""]):
            from isel_twin.bridge.pty import PtyEndpoint

            endpoints.append(PtyEndpoint(link or None))
            stack.callback(endpoints[-1].close)
        if tcps or rfc2217s:
            from isel_twin.bridge.rfc2217 import Rfc2217Codec
            from isel_twin.bridge.tcp import TcpEndpoint

            for address in tcps or ():
                endpoints.append(TcpEndpoint(address))
                stack.callback(endpoints[-1].close)
            for address in rfc2217s or ():
                endpoints.append(TcpEndpoint(address, "rfc2217", Rfc2217Codec))
                stack.callback(endpoints[-1].close)
    return endpoints


def addresses(endpoints: Sequence[Endpoint]) -> dict[str, Any]:
    """What a command prints about them: the first of each kind under its name, and all of them as `ports`.

    pty: the link if there is one; `device`: what it leads to.
    """
    ports: list[dict[str, str]] = []
    for endpoint in endpoints:
        link = getattr(endpoint, "link", None)
        port = {"kind": endpoint.kind, "address": link or endpoint.address}
        ports.append({**port, "device": endpoint.address} if link else port)
    first: dict[str, Any] = {}
    for port in ports:
        if port["kind"] not in first:
            first[port["kind"]] = port["address"]
            if "device" in port:
                first["device"] = port["device"]
    return {**first, "ports": ports} if len(first.keys() - {"device"}) < len(ports) else first
