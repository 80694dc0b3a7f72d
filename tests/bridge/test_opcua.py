"""Clients of OPC UA: asyncua's own tools and client, at a real `isel-twin opcua` beside a real `serve`."""

from __future__ import annotations

import asyncio
import errno
import signal
import socket
import stat
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, Server, tools, ua
from asyncua.common.node import Node
from asyncua.crypto import cert_gen
from asyncua.crypto.cert_gen import (
    dump_private_key_as_pem,
    generate_private_key,
    generate_self_signed_app_certificate,
)
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509 import UniformResourceIdentifier
from cryptography.x509.oid import ExtendedKeyUsageOID

from isel_twin.bridge.opcua import nodes
from isel_twin.bridge.opcua import server as opcua_server
from isel_twin.bridge.opcua.access import Access, Readers, secure
from isel_twin.bridge.opcua.alerts import ALERT, GONE
from isel_twin.bridge.opcua.nodes import MESSAGES, NAMESPACES, NODES
from isel_twin.bridge.opcua.server import Serving
from isel_twin.bridge.operate.client import Client as ControlClient
from isel_twin.bridge.operate.conditions import alerts, conditions, emergency, powered, program
from isel_twin.bridge.pytest.kept import ServedTwin
from isel_twin.bridge.serve.tcp import listen
from isel_twin.core.twin import Twin
from tests.bridge.conftest import REPLY_S, Served
from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=16)

BAD = "BadNoCommunication"
CLIENTS = 4  # at once, where the limit is looked at


@pytest.fixture
def beside(serve: Any) -> Iterator[tuple[Served, Served]]:
    """A served twin, and the server beside it."""
    machine = serve("--control", "127.0.0.1:0", "--tcp", "127.0.0.1:0", speed="1")
    call = (machine.info["control"], "--tcp", "127.0.0.1:0", "--interval", "0.02")
    shown = Served(call, "opcua")
    yield machine, shown
    shown.process.kill()
    shown.process.communicate()


async def machine_in(client: Client) -> Node:
    """The machine, found as a client finds it: below the folder of the companion specification."""
    machines = await client.nodes.objects.get_child(await named(client, "Machinery:Machines"))
    (found,) = [one for one in await machines.get_children() if "4030" in (await one.read_browse_name()).Name]
    return found


async def named(client: Client, path: str) -> list[ua.QualifiedName]:
    """Browse names of a path with prefixes."""
    uris = await client.get_namespace_array()
    parts = [part.rpartition(":") for part in path.split("/")]
    return [ua.QualifiedName(name, uris.index(NAMESPACES[prefix]) if prefix else 0) for prefix, _, name in parts]


async def variable(client: Client, path: str) -> Node:
    """A variable of the machine."""
    return await (await machine_in(client)).get_child(await named(client, path))


async def value_of(node: Node) -> Any:
    """Value of a variable; the name of its status if that is bad."""
    value = await node.read_data_value(raise_on_bad_status=False)
    return value.Value.Value if value.StatusCode.is_good() else value.StatusCode.name


async def seen(client: Client, path: str) -> Any:
    return await value_of(await variable(client, path))


async def until(client: Client, path: str, value: Any) -> None:
    node = await variable(client, path)
    async with asyncio.timeout(REPLY_S):
        while await value_of(node) != value:
            await asyncio.sleep(0.01)


async def mandatory(kind: Node) -> list[tuple[tuple[int, str], Node]]:
    """Children that a type, or a type above it, demands, and what they are like."""
    found: dict[tuple[int, str], Node] = {}
    while True:
        for child in await kind.get_children():
            rules = [await rule.read_browse_name() for rule in await child.get_referenced_nodes(37)]
            if "Mandatory" in [rule.Name for rule in rules]:
                name = await child.read_browse_name()
                found.setdefault((name.NamespaceIndex, name.Name), child)
        above = await kind.get_referenced_nodes(ua.ObjectIds.HasSubtype, ua.BrowseDirection.Inverse)
        if not above:
            return list(found.items())
        kind = above[0]


async def complete(client: Client, node: Node, like: Node | None = None) -> int:
    """Check that the node has what its type demands, and what is demanded of `like` in the type around it, each
    variable with a good value. How many variables that are."""
    kinds = [client.get_node(await node.read_type_definition()), *([like] if like else [])]
    wanted = {name: child for kind in kinds for name, child in await mandatory(kind)}
    count = 0
    for name, child in wanted.items():
        have = await node.get_child([ua.QualifiedName(name[1], name[0])])
        if await have.read_node_class() == ua.NodeClass.Variable:
            value = await have.read_data_value()
            assert value.Value.Value is not None, name
            assert (await client.get_node(await have.read_data_type()).read_browse_name()).Name
            count += 1
        count += await complete(client, have, child)
    return count


async def looks_like_its_value(node: Node) -> None:
    """ValueRank (OPC 10000-3, 5.6.2) is that of the value: -1 a scalar, 1 an array of one dimension."""
    rank = (await node.read_attribute(ua.AttributeIds.ValueRank)).Value.Value
    assert rank == (1 if (await node.read_data_value()).Value.is_array else -1), node


async def at_a_bounded_rate(client: Client, interval_s: float) -> None:
    """The time of a machine that is looked at each interval_s, by a client that asks for a sample each ms."""
    node, told = await variable(client, "Twin:VirtualTime"), Values()
    assert (await node.read_attribute(ua.AttributeIds.MinimumSamplingInterval)).Value.Value == 1000.0 * interval_s
    clock = asyncio.get_running_loop().time
    subscription = await client.create_subscription(1, told)
    began_s = clock()
    await subscription.subscribe_data_change(node, queuesize=1000, sampling_interval=1.0)
    async with asyncio.timeout(REPLY_S):
        while len(told.values) < 10:
            await asyncio.sleep(0.01)
    assert len(told.values) <= (clock() - began_s) / interval_s + 2, "the first at once, one on its way"
    await subscription.delete()


def test_the_companion_specification_and_what_happens(
    beside: tuple[Served, Served], serve: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything mandatory is there with a value; what happens shows; a client vanishes, a stranger talks nonsense; the
    twin goes and another comes at its address."""
    machine, shown = beside
    url, control = shown.info["opcua"], machine.info["control"]

    async def look() -> None:
        async with Client(url) as client, Client(url) as other:
            found = await machine_in(client)
            assert await complete(client, found) == 9
            channel = await found.get_child(await named(client, "MT:Monitoring/MT:Channel"))
            assert await complete(client, channel) == 6
            for node in NODES:
                assert await seen(client, node.path) is not None
                await looks_like_its_value(await variable(client, node.path))
            await at_a_bounded_rate(client, 0.02)
            assert await seen(client, "MT:Monitoring/MT:MachineTool/MT:OperationMode") == 1
            assert await seen(client, "DI:Identification/DI:ProductInstanceUri") == "urn:isel-twin:4030:0"
            axis = await found.get_child(await named(client, "Twin:Axes/Twin:X/Twin:ActualPosition"))
            unit = await (await axis.get_child("0:EngineeringUnits")).read_value()
            assert (unit.DisplayName.Text, unit.UnitId) == ("mm", int.from_bytes(b"MMT"))
            assert [(await one.read_browse_name()).Name for one in await axis.get_children()] == ["EngineeringUnits"]
            with pytest.raises(ua.UaStatusCodeError):
                await axis.write_value(1.0)
            with pytest.raises(ua.UaStatusCodeError):
                await client.nodes.objects.add_object(2, "mine")
            with socket.create_connection(url[len("opc.tcp://") : -1].rsplit(":", 1)) as stranger:
                stranger.sendall(b"GET / HTTP/1.1\r\n\r\n" + bytes(range(256)) * 64)
            other.uaclient.protocol.transport.abort()
            isel_twin("ctl", control, "set", "estop=pressed", "key=setup", "hood=open")
            await until(client, "Twin:Safety/Twin:EmergencyStop", True)
            assert await seen(client, "Twin:Conditions") == ["the safety relay is open", "emergency stop"]
            await until(client, "MT:Monitoring/MT:MachineTool/MT:OperationMode", 2)
            await until(client, "Twin:Safety/Twin:HoodClosed", False)
            assert machine.stop(signal.SIGTERM) == 0
            await until(client, "Twin:VirtualTime", BAD)
            assert await seen(client, "MT:Production/MT:ActiveProgram/MT:State/CurrentState") == BAD
            assert await seen(client, "DI:Identification/DI:SerialNumber") == "0", "what it is stays known"
            assert await client.get_node(ua.NodeId(ua.ObjectIds.Server_ServiceLevel)).read_value() == 1
            serve("--control", control, "--tcp", "127.0.0.1:0", "--seed", "5")
            await until(client, "DI:Identification/DI:SerialNumber", "5")
            await until(client, "Twin:Safety/Twin:EmergencyStop", False)

    asyncio.run(look())
    path = "0:Objects,4:Machines,6:4030,5:Production,5:ActiveProgram,5:State,0:CurrentState"
    monkeypatch.setattr(sys, "argv", ["uaread", "-u", url, "-p", path, "-t", "python"])
    with pytest.raises(SystemExit) as done:
        tools.uaread()
    assert (done.value.code or 0) == 0
    assert "Ended" in capsys.readouterr().out
    second = isel_twin("opcua", control, "--tcp", url[len("opc.tcp://") : -1])
    assert (second.returncode, second.stderr.count("\n")) == (2, 1)
    assert "in use" in second.stderr
    assert shown.stop(signal.SIGTERM) == 0


class Values:
    """Values that a subscription has told."""

    def __init__(self) -> None:
        self.values: list[Any] = []

    def datachange_notification(self, node: Node, value: Any, data: Any) -> None:
        self.values.append(value)


class Told:
    """What a subscription has told: of each event its name, whether it is active, text and severity."""

    def __init__(self) -> None:
        self.events: list[Any] = []

    def event_notification(self, event: Any) -> None:
        self.events.append(event)

    @property
    def short(self) -> list[tuple[str, bool]]:
        return [(event.ErrorCode, getattr(event, "ActiveState/Id")) for event in self.events if event.ErrorCode]

    async def until(self, *wanted: tuple[str, bool]) -> None:
        async with asyncio.timeout(REPLY_S):
            while not {*wanted} <= {*self.short}:
                await asyncio.sleep(0.01)


class Still:
    """The client of a twin that stays as it is."""

    def __init__(self, state: Any) -> None:
        self._state = state

    def __enter__(self) -> Still:
        return self

    def __exit__(self, *_: object) -> None: ...

    def state(self) -> Any:
        return self._state


class Bare:
    """In place of the machine's nodes, where nobody looks at them."""

    def __init__(self, _: Server, interval_s: float) -> None: ...
    async def build(self, _: Any) -> None: ...
    async def show(self, _: Any) -> None: ...


async def listening(serving: Serving, state: Any) -> asyncio.Task[None]:
    """The task of a server, once it listens. Raises what has ended it before."""
    ready = asyncio.Event()
    running = asyncio.create_task(serving.run(state, ready.set))
    waiting = asyncio.create_task(ready.wait())
    await asyncio.wait({running, waiting}, return_when=asyncio.FIRST_COMPLETED)
    if running.done():
        running.result()
    return running


def test_alerts_begin_and_end_and_who_comes_later_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """Hood, E-stop, an end switch that is struck and steps that are lost at the stop behind it; the twin goes."""
    served = ServedTwin(Twin(controller="external", start_mm=(0.5, 100.0, 50.0)))
    listener, where = listen("127.0.0.1:0")
    listener.close()
    told, server_told, late = Told(), Told(), Told()

    async def look() -> None:
        serving = Serving(f"opc.tcp://{where}/", lambda: ControlClient(served.control), 0.05, None)
        before = served.ask({"state": True})
        running = await listening(serving, before)
        async with Client(f"opc.tcp://{where}/") as client:
            kind = ua.NodeId(ALERT, (await client.get_namespace_array()).index(NAMESPACES["MT"]))
            messages = await (await machine_in(client)).get_child(await named(client, MESSAGES))
            for handler, source in ((told, messages), (server_told, client.nodes.server)):
                await (await client.create_subscription(10, handler)).subscribe_events(source, kind)
            with socket.create_connection(served.address.rsplit(":", 1)) as line, line.makefile("rb") as answers:
                line.sendall(b"out power_request=1 stages=1 brake=1\n")
                answers.readline()
                for element, states in (("hood", ("open", "closed")), ("estop", ("pressed", "released"))):
                    for active, state in zip((True, False), states, strict=True):
                        await asyncio.to_thread(served.ask, {"set": {element: state}})
                        await told.until((element, active))
                await asyncio.to_thread(served.ask, {"set": {"power": "on"}})
                await told.until(("power", False))
                line.sendall(b"go 3000 -3200 0 0\n")
                answers.readline()
                await told.until(("limit_x1", True), ("lost_x", True))
            subscription = await client.create_subscription(10, late)
            await subscription.subscribe_events(client.nodes.server, kind)
            condition = client.get_node(ua.NodeId(ua.ObjectIds.ConditionType))
            number = ua.Variant(subscription.subscription_id, ua.VariantType.UInt32)
            await condition.call_method("0:ConditionRefresh", number)
            await late.until(("limit_x1", True), ("lost_x", True))
            await asyncio.to_thread(served.stop)
            for handler in (told, server_told):
                await handler.until(("limit_x1", False), ("lost_x", False))
            serving.stop()
            await running
        assert caplog.text.count("the twin has gone, it is looked for every second: ") == 1

    asyncio.run(look())
    assert told.short[:6] == [
        *(("hood", True), ("hood", False), ("power", True), ("estop", True), ("estop", False), ("power", False))
    ]
    assert {*late.short[:2]} == {("limit_x1", True), ("lost_x", True)}
    assert server_told.short == told.short
    events = {(event.ErrorCode, getattr(event, "ActiveState/Id")): event for event in told.events}
    for name, text, severity in (
        ("hood", "the hood is open", 500),
        ("estop", "the E-stop is pressed", 700),
        ("power", "the safety relay is open", 800),
        ("limit_x1", "end switch x1 is struck", 300),
    ):
        begun = events[name, True]
        assert (begun.Message.Text, begun.Severity, begun.Retain, begun.Quality.is_good()) == (
            text,
            severity,
            True,
            True,
        )
        assert (begun.SourceName, begun.ConditionName, begun.ActiveState.Text) == ("4030", name, "Active")
        assert (begun.EnabledState.Text, getattr(begun, "EnabledState/Id")) == ("Enabled", True)
        assert (begun.AckedState.Text, getattr(begun, "AckedState/Id")) == ("Acknowledged", True)
        assert (begun.SuppressedOrShelved, begun.LastSeverity, begun.BranchId.is_null()) == (False, severity, True)
        assert (begun.ConditionClassName.Text, begun.ClientUserId) == ("SystemConditionClassType", "")
        assert events[name, False].Retain is False
        assert events[name, False].NodeId == begun.NodeId, "the same condition"
    assert events["lost_x", True].Message.Text.startswith("x has lost ")
    assert (events["hood", False].Message.Text, events["hood", False].Quality.is_good()) == ("the hood is open", True)
    gone = events["lost_x", False]
    assert (gone.Message.Text, gone.Quality.name) == (GONE, BAD)
    assert len({event.EventId for event in told.events}) == len(told.events)


def test_silent_clients_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """All places are taken by clients that say nothing more, in sessions or without one; one that goes on asking keeps
    its place. And a server that looks at the twin once an hour ends at once."""
    limits = {"CLIENTS": CLIENTS, "SILENT_S": 2.0, "STRANGE_S": 2.0, "LOOK_S": 0.01}
    for name, instead in {**limits, "Machine": Bare}.items():
        monkeypatch.setattr(opcua_server, name, instead)

    async def silent(url: str) -> Client:
        client = Client(url, timeout=1.0)
        await client.connect_socket()
        await client.send_hello()
        await client.open_secure_channel()
        await client.create_session()
        await client.activate_session()
        return client

    async def closed(where: str) -> None:
        """Connect, and wait for the end of the connection."""
        reader, writer = await asyncio.open_connection(*where.rsplit(":", 1))
        assert await reader.read() == b""
        writer.close()

    async def look() -> None:
        listener, where = listen("127.0.0.1:0")
        listener.close()
        url = f"opc.tcp://{where}/"
        serving = Serving(url, lambda: Still({}), 3600.0, None)
        running = await listening(serving, {})
        async with asyncio.timeout(REPLY_S), Client(url, watchdog_intervall=0.1) as asking:
            quiet = [await silent(url) for _ in range(CLIENTS - 2)]
            assert quiet[0].session_timeout == 2000.0, "told so"
            stranger = asyncio.create_task(closed(where))
            await asyncio.sleep(0)
            with pytest.raises((OSError, ua.UaError, TimeoutError)):
                await silent(url)
            await stranger
            while len(quiet) < 2 * CLIENTS - 3:
                with suppress(OSError, ua.UaError, TimeoutError):
                    quiet.append(await silent(url))
            await asking.nodes.server_state.read_value()
            for client in quiet:
                client.disconnect_socket()
        serving.stop()
        async with asyncio.timeout(REPLY_S):
            await running

    asyncio.run(look())


def test_beyond_loopback_with_a_password_over_an_encrypted_channel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The key for it is made once and whole: a disk that is full leaves no half of it. Later it is the same key, for
    the URI of its certificate, though the computer has another name; what is no certificate is refused with its name.
    """
    access = Access(tmp_path / "server", "secret")
    folder, host = access.folder, socket.gethostname()

    async def keyed(server: Server) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(cert_gen, "dump_private_key_as_pem", lambda _: full())
            with pytest.raises(OSError, match="No space"):
                await secure(server, access)
        assert [path.name for path in folder.iterdir()] == ["certificate.der"]
        await secure(server, access)
        before = (folder / "key.pem").read_bytes()
        with monkeypatch.context() as patch:
            patch.setattr(socket, "gethostname", lambda: "another")
            await secure(server, None)
            assert server.get_application_uri() == "urn:another:isel-twin"
            await secure(server, access)
            assert server.get_application_uri() == f"urn:{host}:isel-twin"
        assert (folder / "key.pem").read_bytes() == before

    async def look() -> None:
        server = Server(user_manager=Readers(access.password))
        await server.init()
        server.set_endpoint("opc.tcp://127.0.0.1:0/")
        await keyed(server)
        async with server:
            assert server.bserver is not None
            url = f"opc.tcp://127.0.0.1:{server.bserver.port}/"
            key = generate_private_key()
            uri = "urn:reader"
            use = [ExtendedKeyUsageOID.CLIENT_AUTH]
            made = generate_self_signed_app_certificate(key, "reader", {}, [UniformResourceIdentifier(uri)], use)
            (tmp_path / "reader.pem").write_bytes(dump_private_key_as_pem(key))
            (tmp_path / "reader.der").write_bytes(made.public_bytes(Encoding.DER))
            for password, secured in (("secret", False), (None, True), ("wrong", True), ("secret", True)):
                client = Client(url)
                client.application_uri = uri
                if password:
                    client.set_user("anybody")
                    client.set_password(password)
                if secured:
                    await client.set_security(
                        SecurityPolicyBasic256Sha256, str(tmp_path / "reader.der"), str(tmp_path / "reader.pem")
                    )
                if (password, secured) != ("secret", True):
                    with pytest.raises((ua.UaError, ConnectionError)):
                        await client.connect()
                    continue
                async with client:
                    level = client.get_node(ua.NodeId(ua.ObjectIds.Server_ServiceLevel))
                    assert await level.read_value() == 255
        (folder / "certificate.der").write_bytes(b"no certificate")
        with pytest.raises(ValueError, match=r"certificate\.der: no certificate"):
            await secure(server, access)

    asyncio.run(look())
    assert stat.S_IMODE((folder / "key.pem").stat().st_mode) == 0o600


def full() -> bytes:
    raise OSError(errno.ENOSPC, "No space left on device")


def state(**changed: Any) -> dict[str, Any]:
    """As the control port tells it, of a machine where nothing is wrong."""
    plain = {"idle": True, "fault": False, "unfinished": "", "outputs": {"power": 1}, "faults": {}, "inputs": {}}
    axes = {"lost_steps": [0, 0, 0], "slip_steps": [32, 32, 32], "drive_faults": [[0, ""]] * 3}
    return {**plain, **axes, **changed}


@pytest.mark.parametrize(
    ("changed", "is_"),
    [
        ({}, "Ended"),
        ({"unfinished": "program 3"}, "Interrupted"),
        ({"idle": False}, "Running"),
        ({"idle": False, "outputs": {}}, "Running"),
        ({"idle": False, "outputs": {"power": 0}}, "Interrupted"),
        ({"idle": False, "fault": True}, "Aborted"),
    ],
)
def test_state_of_the_program(changed: dict[str, Any], is_: str) -> None:
    assert program(state(**changed)) == is_


def test_conditions_name_what_is_wrong() -> None:
    assert set(conditions(state()).values()) == {""}
    changed = {
        "lost_steps": [15.9, -16.0, 0],
        "faults": {"line_cut": True},
        "fault": True,
        "fault_cause": "limit_x2 struck",
    }
    told = conditions(state(**changed, outputs={"power": 0}, drive_faults=[[0, ""], [0, ""], [3, "too far behind"]]))
    assert {name: text for name, text in told.items() if text} == {
        "power": "the safety relay is open",
        "controller": "limit_x2 struck",
        "line": "the line to the host is cut",
        "lost_y": "y has lost -16 steps",
        "drive_z": "drive of z: too far behind",
    }


def test_alerts_are_conditions_and_what_stops_a_machine() -> None:
    assert alerts(state(inputs={"hood": "closed", "estop": "released", "limit_x1": "free", "probe": "touched"})) == {}
    told = alerts(state(inputs={"hood": "forced", "estop": "pressed", "limit_y2": "struck"}, fault=True))
    assert {name: alert.severity for name, alert in told.items()} == {
        **{"controller": 800, "estop": 700, "hood": 500, "limit_y2": 300}
    }


@pytest.mark.parametrize(
    ("changed", "power", "stopped"),
    [
        ({}, True, False),
        ({"inputs": {"estop": "released"}}, True, False),
        ({"inputs": {"estop": "pressed"}}, True, True),
        ({"outputs": {"power": 0}}, False, True),
        ({"outputs": {}}, True, False),
    ],
)
def test_emergency_is_the_button_or_the_relay(changed: dict[str, Any], power: bool, stopped: bool) -> None:
    assert (powered(state(**changed)), emergency(state(**changed))) == (power, stopped)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["127.0.0.1:1"], "is there a serve --control?"),
        (["127.0.0.1:1", "--tcp", "0.0.0.0:0"], "beyond the loopback interface --certificates and --password-file"),
        (["127.0.0.1:1", "--certificates", "keys"], "--certificates and --password-file go together"),
        (["127.0.0.1:1", "--tcp", "here"], "is not HOST:PORT"),
        (["127.0.0.1:1", "--interval", "0"], "--interval"),
    ],
)
def test_what_cannot_be_is_one_line(words: list[str], line: str) -> None:
    done = isel_twin("opcua", *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert line in done.stderr


def test_without_the_extra_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "isel_twin.bridge.opcua.access", None)
    done = isel_twin("opcua", "127.0.0.1:1")
    assert (done.returncode, done.stderr) == (2, "isel-twin: opcua needs asyncua: pip install 'isel-twin[opcua]'\n")


def test_values_of_a_machine_at_work() -> None:
    """Numbers of OPC 40501-1: OperationMode Setup is 2, ChannelState Active 0, ChannelMode Remote 5; the program's
    state Running has the number 1 and the id 5041."""
    told = state(idle=False, inputs={"key": "setup", "hood": "open"}, outputs={"power": 1, "spindle_runs": 1})
    told |= {"machine": "4030", "seed": 7, "controller": "a controller", "keys": {}, "time_s": 1.5}
    told |= {"position_mm": [1.0, 2.0, 3.0], "position_error_mm": [0.25, 0.0, -1.0], "lost_steps": [20.0, 0.0, 0.0]}
    told |= {"drive_faults": [[0, "of no matter"], [0, ""], [2, "too hot"]]}
    values = {node.path.replace("MT:", "").replace("Twin:", ""): node.value(told) for node in NODES}
    what = ("ActualPosition", "CommandedPosition", "LostSteps", "DriveFault")
    place = {"X": (1.0, 0.75, 20.0, ""), "Y": (2.0, 2.0, 0.0, ""), "Z": (3.0, 4.0, 0.0, "too hot")}
    axes = {f"Axes/{axis}/{name}": one for axis in place for name, one in zip(what, place[axis], strict=True)}
    assert values == {
        "DI:Identification/DI:Manufacturer": "isel (simulated)",
        "DI:Identification/DI:SerialNumber": "7",
        "DI:Identification/DI:ProductInstanceUri": "urn:isel-twin:4030:7",
        "DI:Identification/DI:Model": "4030",
        "Monitoring/MachineTool/OperationMode": 2,
        "Monitoring/Channel/Name": "a controller",
        "Monitoring/Channel/ChannelState": 0,
        "Monitoring/Channel/ChannelMode": 5,
        "Monitoring/Channel/FeedOverride": 100.0,
        "Monitoring/Spindle/Name": "spindle",
        "Monitoring/Spindle/IsRotating": True,
        "Production/ActiveProgram/Name": "",
        "Production/ActiveProgram/NumberInList": 0,
        "Production/ActiveProgram/State/CurrentState": "Running",
        "Production/ActiveProgram/State/CurrentState/Id": 5041,
        "Production/ActiveProgram/State/CurrentState/Number": 1,
        **axes,
        "Safety/EmergencyStop": False,
        "Safety/Power": True,
        "Safety/HoodClosed": False,
        "Conditions": ["x has lost 20 steps", "drive of z: too hot"],
        "VirtualTime": 1.5,
    }


@pytest.mark.parametrize(
    ("changed", "channel"),
    [({}, 2), ({"idle": False}, 0), ({"unfinished": "program 3"}, 1), ({"fault": True}, 1)],
)
def test_numbers_of_a_program_are_those_of_the_node_set(changed: dict[str, Any], channel: int) -> None:
    """Numbers and ids as the published set has them: StateNumber of each state of ProductionStateMachineType."""
    told = state(**changed, keys={})
    values = {node.path.rpartition("/")[2]: node.value(told) for node in NODES[6:16]}
    tree = ElementTree.parse(Path(nodes.__file__).parent / "nodesets" / "machine_tool.xml")
    own = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
    name = next(
        one.get("BrowseName") for one in tree.iter(f"{own}UAObject") if one.get("NodeId") == f"ns=1;i={values['Id']}"
    )
    (number,) = [
        int("".join(one.itertext()).split()[-1])
        for one in tree.iter(f"{own}UAVariable")
        if one.get("ParentNodeId") == f"ns=1;i={values['Id']}" and one.get("BrowseName") == "StateNumber"
    ]
    assert (name, number) == (f"1:{values['CurrentState']}", values["Number"])
    assert values["MT:ChannelState"] == channel


def test_control_with_programs_of_its_own_shows_mode_override_and_program() -> None:
    """ChannelMode of OPC 40501-1: Automatic 0, MdaMdi 1, JogManual 2."""
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic")
    shown = {
        node.path.rpartition("MT:")[2]: node for node in NODES if "Channel/" in node.path or "Program" in node.path
    }
    numbers = {"hand": 2, "auto": 0, "single": 0, "positioning": 1}
    assert set(numbers) == set(twin.keys["mode"].value)
    for mode, number in numbers.items():
        told = {"keys": {**twin.key_values, "mode": mode, "override": 40.0, "program": 7}}
        values = [shown[name].value(told) for name in ("ChannelMode", "FeedOverride", "Name")]
        assert values == [number, 40.0, "7"]
    assert shown["Name"].value({"keys": twin.key_values}) == ""
