"""The server beside a served twin: the address space, kept up to date out of states of the control port.

It is a client of the control port, like anything that stands beside a twin (bridge/28). Without the twin its values are
bad (BadNoCommunication) until one answers at the address again.
"""

from __future__ import annotations

import asyncio
import datetime
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from asyncua import Server, ua
from asyncua.common.instantiate_util import instantiate
from asyncua.common.node import Node as UaNode
from asyncua.server.internal_session import SessionState

from isel_twin.bridge.opcua.access import Access, Readers, secure
from isel_twin.bridge.opcua.alerts import ALERT, Alerts, node_id
from isel_twin.bridge.opcua.nodes import MACHINE_TOOL, MESSAGES, NAMESPACES, NODES, OPTIONAL, OWN, UNITS, Node
from isel_twin.bridge.operate.client import Client, ClientError
from isel_twin.bridge.operate.conditions import State, alerts
from isel_twin.version import VERSION

log = logging.getLogger("isel_twin")

SETS = ("di", "ia", "machinery", "machine_tool")  # in the order of their needs
MACHINES = 1001  # the folder of all machines, in the namespace Machinery
CLIENTS = 16  # connections at once
SILENT_S = 60.0  # wall time that a client may say nothing, unless it has asked for less
STRANGE_S = 5.0  # wall time that a connection may be without a session
LOOK_S = 0.5  # wall time between two looks for sessions that are over
AGAIN_S = 1.0  # wall time between two tries to reach a twin that has gone
FULL, NO_DATA = 255, 1  # ServiceLevel (OPC 10000-4, 6.6.2.4.2)
UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"


def _now(value: ua.Variant, status: int = ua.StatusCodes.Good) -> ua.DataValue:
    now: Any = datetime.datetime.now(datetime.UTC)
    return ua.DataValue(value, ua.StatusCode(ua.UInt32(status)), now)


class Machine:
    """The machine's nodes in a server. interval_s: least wall time between two calls of `show`."""

    def __init__(self, server: Server, interval_s: float) -> None:
        self._server, self._interval_s = server, interval_s
        self._index: dict[str, int] = {}  # of a namespace, by its prefix
        self._nodes: dict[Node, ua.NodeId] = {}
        self._known: dict[Node, Any] = {}
        self._alerts: Alerts

    async def build(self, state: State) -> None:
        """Take the types in and make the machine, with the mandatory nodes of its type and those of NODES."""
        folder = Path(__file__).parent / "nodesets"
        for name in SETS:
            await self._server.import_xml(str(folder / f"{name}.xml"))
        self._index = {prefix: await self._server.register_namespace(uri) for prefix, uri in NAMESPACES.items()}
        machines = self._server.get_node(node_id(MACHINES, self._index["Machinery"]))
        root = await self._object(machines, f"Twin:{state['machine']}", MACHINE_TOOL)
        for path, kind in OPTIONAL:
            *above, name = path.split("/")
            await self._object(await root.get_child([self._name(part) for part in above]), name, kind)
        messages = await root.get_child([self._name(part) for part in MESSAGES.split("/")])
        self._alerts = Alerts(self._server, root, messages)
        await self._alerts.build(node_id(ALERT, self._index["MT"]))
        for node in NODES:
            self._nodes[node] = (await self._variable(root, node, state)).nodeid

    async def show(self, state: State) -> None:
        """Write what has changed."""
        for node, where in self._nodes.items():
            value = node.value(state)
            if node not in self._known or self._known[node] != value:
                self._known[node] = value
                await self._server.write_attribute_value(where, _now(self._variant(node, value)))
        await self._alerts.show(alerts(state))
        await self._level(FULL)

    async def lose(self) -> None:
        """There is no twin: nothing is known but what the machine is."""
        for node, where in self._nodes.items():
            if node in self._known and not node.lasting:
                del self._known[node]
                gone = _now(ua.Variant(), ua.StatusCodes.BadNoCommunication)
                await self._server.write_attribute_value(where, gone)
        await self._alerts.show({}, gone=True)
        await self._level(NO_DATA)

    # Inside

    async def _level(self, level: int) -> None:
        told = ua.DataValue(ua.Variant(level, ua.VariantType.Byte))
        await self._server.write_attribute_value(node_id(ua.ObjectIds.Server_ServiceLevel), told)

    def _variant(self, node: Node, value: Any) -> ua.Variant:
        if node.kind == "LocalizedText":
            value = ua.LocalizedText(value, "en")
        if node.kind == "NodeId":
            value = node_id(value, self._index["MT"])
        return ua.Variant(value, ua.VariantType[node.kind], is_array=isinstance(value, list))

    async def _object(self, above: UaNode, name: str, kind: int) -> UaNode:
        """A new object of a type of MT, with the mandatory nodes of that type."""
        return await above.add_object(*self._ids(above, name), node_id(kind, self._index["MT"]), False)

    async def _variable(self, root: UaNode, node: Node, state: State) -> UaNode:
        """The variable of a node: one that its object's type has made, else a new one, in new folders."""
        above, path = root, node.path.split("/")
        for name in path[:-1]:
            above = await self._there(above, name) or await above.add_folder(*self._ids(above, name))
        found = await self._there(above, path[-1]) or await self._new(above, path[-1], node, state)
        if node.unit:
            code, symbol, name = UNITS[node.unit]
            unit = ua.EUInformation(UNECE, ua.Int32(code), ua.LocalizedText(symbol), ua.LocalizedText(name))
            await (await found.get_child("0:EngineeringUnits")).write_value(unit)
        if node.range:
            await (await found.get_child("0:EURange")).write_value(ua.Range(*map(ua.Double, node.range)))
        several = isinstance(node.value(state), list)
        rank = ua.Variant(ua.ValueRank.OneDimension if several else ua.ValueRank.Scalar, ua.VariantType.Int32)
        await found.write_attribute(ua.AttributeIds.ValueRank, ua.DataValue(rank))
        interval_ms = ua.Variant(1000.0 * self._interval_s, ua.VariantType.Double)  # no client is told more often
        await found.write_attribute(ua.AttributeIds.MinimumSamplingInterval, ua.DataValue(interval_ms))
        return found

    async def _new(self, above: UaNode, name: str, node: Node, state: State) -> UaNode:
        ids, value = self._ids(above, name), self._variant(node, node.value(state))
        kind = node_id(value.VariantType.value)
        if not name.startswith("Twin:"):
            return await above.add_property(*ids, value.Value, value.VariantType, kind)
        if not node.unit:
            return await above.add_variable(*ids, value.Value, value.VariantType, kind)
        analog = self._server.get_node(node_id(ua.ObjectIds.AnalogUnitType))
        found, *_ = await instantiate(above, analog, *ids, instantiate_optional=False)
        await found.write_attribute(ua.AttributeIds.DataType, ua.DataValue(ua.Variant(kind)))
        return found

    def _name(self, text: str) -> ua.QualifiedName:
        prefix, _, name = text.rpartition(":")
        return ua.QualifiedName(name, self._index[prefix] if prefix else 0)

    def _ids(self, above: UaNode, name: str) -> tuple[ua.NodeId, ua.QualifiedName]:
        """Id, as asyncua makes those of a type's nodes, and browse name of a new node."""
        own, bare = self._index["Twin"], self._name(name)
        inside = f"{above.nodeid.Identifier!s}." if above.nodeid.NamespaceIndex == own else ""
        return node_id(f"{inside}{bare.Name}", own), bare

    async def _there(self, above: UaNode, name: str) -> UaNode | None:
        try:
            return await above.get_child([self._name(name)])
        except ua.uaerrors.BadNoMatch:
            return None


async def _let_go(server: Server) -> None:
    """Cut off whose session is over, again and again: asyncua ends it, and keeps the connection (bridge/33)."""
    while True:
        for client in [] if server.bserver is None else [*server.bserver.clients]:
            session = None if client.processor is None else client.processor.session
            if session is not None and session.state is SessionState.Closed and client.transport is not None:
                client.transport.abort()  # who does not read would keep it from being closed
        await asyncio.sleep(LOOK_S)


class Serving:
    """A server and the twin that it shows."""

    def __init__(self, url: str, connect: Callable[[], Client], interval_s: float, access: Access | None) -> None:
        """url: opc.tcp://HOST:PORT/. connect: raises ClientError while there is no twin."""
        self._url, self._connect, self._interval_s, self._access = url, connect, interval_s, access
        self._end = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    def stop(self) -> None:
        """End `run` soon; for signal handlers."""
        if self._loop is None:
            self._end.set()
        else:
            self._loop.call_soon_threadsafe(self._end.set)

    async def run(self, state: State, said: Callable[[], object]) -> None:
        """Serve until `stop`, beginning with this state of the twin. said: called when it listens. Raises OSError."""
        self._loop = asyncio.get_running_loop()
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it logs what strangers send, with tracebacks
        server = Server(user_manager=Readers(self._access.password if self._access else None))
        server.iserver.max_connections = CLIENTS
        server.iserver.max_session_timeout_ms = 1000.0 * SILENT_S
        server.iserver.max_pending_activation_seconds = STRANGE_S
        server.iserver.bind_condition_methods = True  # ConditionRefresh
        await server.init()
        server.set_endpoint(self._url)
        server.set_server_name("isel-twin")
        now = datetime.datetime.now(datetime.UTC)
        await server.set_build_info(OWN, "isel-twin", "isel-twin", VERSION, VERSION, now)
        await secure(server, self._access)
        machine = Machine(server, self._interval_s)
        await machine.build(state)
        await machine.show(state)
        async with server:
            said()
            looking = asyncio.create_task(_let_go(server))
            try:
                await self._follow(machine)
            finally:
                looking.cancel()

    async def _follow(self, machine: Machine) -> None:
        gone = False
        while not self._end.is_set():
            try:
                with await asyncio.to_thread(self._connect) as client:
                    while not self._end.is_set():
                        await machine.show(await asyncio.to_thread(client.state))
                        gone = False
                        await self._pause(self._interval_s)
            except ClientError as error:
                if not gone:
                    log.warning("the twin has gone, it is looked for every second: %s", error)
                gone = True
                await machine.lose()
                await self._pause(AGAIN_S)

    async def _pause(self, seconds: float) -> None:
        with suppress(TimeoutError):
            await asyncio.wait_for(self._end.wait(), seconds)
