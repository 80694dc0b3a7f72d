"""`isel-twin mtconnect`: a served machine for MTConnect agents."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options


def mtconnect(
    address: Annotated[str, Parameter(help="HOST:PORT, what serve prints as control.")],
    /,
    *,
    tcp: Annotated[str, Parameter(help="HOST:PORT for agents; port 0: a free one.")] = "127.0.0.1:7878",
    devices: Annotated[Path | None, options.written("Write the agent's Devices.xml here.", ".xml", bare=True)] = None,
    interval: Annotated[float, Parameter(help="Seconds between two looks at the machine.")] = 0.1,
    token_file: Annotated[Path | None, Parameter(help="Holds what the server wants to be told.")] = None,
) -> int:
    """An MTConnect adapter (SHDR) beside `isel-twin serve --control`, until that ends.

    Agents can only look. Beyond the loopback interface anyone who reaches the port can: SHDR knows no tokens.
    """
    from isel_twin.base.files import atomic_write
    from isel_twin.bridge.mtconnect import items
    from isel_twin.bridge.mtconnect.adapter import Adapter
    from isel_twin.bridge.operate.client import Client, ClientError
    from isel_twin.bridge.serve.loop import on_signals
    from isel_twin.cli.outputs import say_json

    options.check_seconds("interval", interval, 0.01)
    options.check_writable(devices)
    try:
        client = Client(address, options.token(token_file))
        state = client.state()
    except ClientError as error:
        raise CallError(str(error)) from None
    with client:
        if devices is not None:
            with call_errors(devices):
                atomic_write(devices, items.devices(state))
        with call_errors():
            adapter = Adapter(tcp, client.state, interval)
        with on_signals(adapter.stop):
            say_json({"mtconnect": adapter.address, "machine": state["machine"]})
            adapter.run()
    return 0
