"""Alerts of the machine as events of AlertType (OPC 40501-1, 9.1): one when something begins, one when it is over.

    state -> alerts (conditions.py) -> which have begun or ended -> an event at Notification/Messages, and at the server

Who subscribes at the server gets by ConditionRefresh what is active already. Nobody acknowledges anything (bridge/32).
"""

from __future__ import annotations

import copy
import datetime
import uuid
from collections.abc import Mapping
from typing import Any

from asyncua import Server, ua
from asyncua.common.node import Node

from isel_twin.bridge.operate.conditions import Alert

ALERT = 39  # AlertType in the namespace MT
GONE = "not known any more: the twin has gone"


def node_id(name: Any, index: Any = 0) -> ua.NodeId:
    """Name: a number or a text."""
    return ua.NodeId(name, index)


def _text(text: str) -> ua.LocalizedText:
    return ua.LocalizedText(text, "en")


class Alerts:
    """What is active, and the events about it."""

    def __init__(self, server: Server, source: Node, messages: Node) -> None:
        """source: the machine. messages: its object that emits."""
        self._server, self._source, self._messages = server, source, messages
        self._active: dict[str, Alert] = {}
        self._pattern: Any = None

    async def build(self, kind: ua.NodeId) -> None:
        """Make a pattern of events of this type."""
        made = await self._server.get_event_generator(kind, self._messages.nodeid)
        await self._server.get_event_generator(kind)
        event = made.event
        event.add_property("ErrorCode", None, ua.VariantType.String)  # asyncua does not see its type
        event.SourceNode = self._source.nodeid
        event.SourceName = (await self._source.read_browse_name()).Name
        event.ConditionClassId = node_id(ua.ObjectIds.SystemConditionClassType)
        event.ConditionClassName = _text("SystemConditionClassType")
        event.BranchId = event.InputNode = ua.NodeId()
        event.Comment, event.ClientUserId, event.SuppressedOrShelved = _text(""), "", False
        for name, state in (("Enabled", "Enabled"), ("Acked", "Acknowledged")):
            setattr(event, f"{name}State", _text(state))
            setattr(event, f"{name}State/Id", True)
        self._pattern = event

    async def show(self, now: Mapping[str, Alert], gone: bool = False) -> None:
        """Tell what has begun and what is over. gone: since nobody knows any more."""
        before, self._active = self._active, dict(now)
        for name, alert in before.items():
            if name not in now:
                await self._tell(name, Alert(GONE, alert.severity) if gone else alert, active=False, known=not gone)
        for name, alert in now.items():
            if name not in before:
                await self._tell(name, alert, active=True)

    async def _tell(self, name: str, alert: Alert, active: bool, known: bool = True) -> None:
        event = copy.deepcopy(self._pattern)
        event.EventId = uuid.uuid4().bytes
        event.Time = event.ReceiveTime = datetime.datetime.now(datetime.UTC)
        event.Message, event.Severity = _text(alert.text), alert.severity
        event.LastSeverity = alert.severity
        event.ErrorCode = event.ConditionName = name
        event.NodeId = node_id(f"{event.SourceName}.Alerts.{name}", self._source.nodeid.NamespaceIndex)
        event.Retain = active
        event.ActiveState = _text("Active" if active else "Inactive")
        setattr(event, "ActiveState/Id", active)
        status = ua.StatusCodes.Good if known else ua.StatusCodes.BadNoCommunication
        event.Quality = ua.StatusCode(ua.UInt32(status))
        at_server = copy.copy(event)
        at_server.emitting_node = node_id(ua.ObjectIds.Server)
        for one in (event, at_server):  # what comes last is what a refresh tells again
            await self._server.iserver.isession.subscription_service.trigger_event(one)
