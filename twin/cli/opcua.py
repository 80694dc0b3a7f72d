"""`isel-twin opcua`: a served machine for OPC UA clients."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options


def opcua(
    address: Annotated[str, Parameter(help="HOST:PORT, what serve prints as control.")],
    /,
    *,
    tcp: Annotated[str, Parameter(help="HOST:PORT for clients; port 0: a free one.")] = "127.0.0.1:4840",
    interval: Annotated[float, Parameter(help="Seconds between two looks at the machine.")] = 0.1,
    token_file: Annotated[Path | None, Parameter(help="Holds what the server wants to be told.")] = None,
    certificates: Annotated[Path | None, Parameter(help="Folder of key and certificate; made if missing.")] = None,
    password_file: Annotated[Path | None, Parameter(help="Its first line is the password of all users.")] = None,
) -> int:
    """An OPC UA server beside `isel-twin serve --control`: companion specification for machine tools (OPC 40501-1).

    Clients can only look. Beyond the loopback interface --certificates and --password-file are needed: channels are
    encrypted then, and users have the password. While the twin is gone, values are bad; it is looked for every second.
    """
    import asyncio

    from isel_twin.bridge.operate.client import Client, ClientError
    from isel_twin.bridge.operate.token import is_loopback
    from isel_twin.bridge.serve.loop import on_signals
    from isel_twin.bridge.serve.tcp import listen
    from isel_twin.cli.outputs import say_json

    try:
        from isel_twin.bridge.opcua.access import Access
        from isel_twin.bridge.opcua.server import Serving
    except ImportError:
        raise CallError("opcua needs asyncua: pip install 'isel-twin[opcua]'") from None
    options.check_seconds("interval", interval, 0.01)
    if (certificates is None) != (password_file is None):
        raise CallError("--certificates and --password-file go together")
    access = None
    if certificates is not None and password_file is not None:
        access = Access(certificates, options.token(password_file) or "")
    with call_errors():
        listener, where = listen(tcp)
        listener.close()
    if access is None and not is_loopback(where):
        raise CallError(f"{where}: beyond the loopback interface --certificates and --password-file are needed")
    token = options.token(token_file)
    url = f"opc.tcp://{where}/"
    serving = Serving(url, lambda: Client(address, token), interval, access)
    try:
        with Client(address, token) as client:
            state = client.state()
    except ClientError as error:
        raise CallError(str(error)) from None
    with on_signals(serving.stop), call_errors(certificates):
        asyncio.run(serving.run(state, lambda: say_json({"opcua": url, "machine": state["machine"]})))
    return 0
