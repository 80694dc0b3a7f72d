"""`isel-twin ports`: the serial ports of this computer, served ones and real ones."""

from __future__ import annotations

from typing import Annotated, Any

from cyclopts import Parameter


def ports(*, json: Annotated[bool, Parameter(help="One JSON object.")] = False) -> int:
    """List the ports that are served on this computer now, and the serial ports that pySerial finds.

    A program that takes only names such as /dev/ttyS9 needs a link under such a name: `serve --pty /dev/ttyS9` as root,
    or `sudo ln -s /dev/pts/7 /dev/ttyS9`; on Windows a pair of com0com and a bridge to a network port (docs/bench.md).
    """
    from serial.tools.list_ports import comports

    from isel_twin.bridge.serve.registry import served
    from isel_twin.cli.outputs import say_json

    served_now = served()
    found = sorted(comports())
    real = [{"device": each.device, "description": each.description, "hardware": each.hwid} for each in found]
    if json:
        say_json({"served": served_now, "real": real})
        return 0
    rows = [row for server in served_now for row in _rows(server)]
    print("served now:" if rows else "served now: none")
    for row in rows:
        print(row)
    print("serial ports of this computer:" if real else "serial ports of this computer: none")
    for port in real:
        print(f"  {port['device']:<28}  {port['description']}".rstrip())
    return 0


def _rows(server: dict[str, Any]) -> list[str]:
    named = [str(server[key]) for key in ("machine", "controller", "tap") if key in server]
    about = "  ".join([str(server.get("command", "")), *named, f"process {server.get('pid')}"])
    return [f"  {_url(port):<28}  {about}" for port in server["ports"] if isinstance(port, dict)]


def _url(port: dict[str, Any]) -> str:
    """The pySerial URL that a host opens."""
    address = str(port.get("address"))
    kind = port.get("kind")
    if kind == "pty":
        return f"{address} -> {port['device']}" if "device" in port else address
    return f"{'socket' if kind == 'tcp' else kind}://{address}"
