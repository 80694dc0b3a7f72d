"""Port settings of hosts compared with the controller's line."""

from __future__ import annotations

import logging
import math

from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.endpoints import name_of
from isel_twin.controller import SerialFormat

log = logging.getLogger("isel_twin")


def host_format(endpoint: Endpoint, line: SerialFormat) -> SerialFormat:
    """A host's port format; unknown settings are assumed to be those of the line (bridge/11)."""
    settings = endpoint.settings
    return SerialFormat(
        settings.get("baudrate", line.baud),
        settings.get("bytesize", line.data_bits),
        settings.get("parity", line.parity),
        math.ceil(settings.get("stopbits", line.stop_bits)),
    )


def fits(endpoint: Endpoint, line: SerialFormat) -> bool:
    """True if the host's known settings are the line's. A second stop bit is a harmless pause."""
    host = host_format(endpoint, line)
    return (host.baud, host.data_bits, host.parity) == (line.baud, line.data_bits, line.parity)


class MisfitLog:
    """Warns of hosts whose settings do not fit the line, once for each setting. strict: their bytes are garbled."""

    def __init__(self, strict: bool) -> None:
        self._strict = strict
        self._told: dict[Endpoint, SerialFormat] = {}

    def compare(self, endpoint: Endpoint, line: SerialFormat) -> None:
        if fits(endpoint, line):
            self._told.pop(endpoint, None)
            return
        host = host_format(endpoint, line)
        if self._told.get(endpoint) == host:
            return
        self._told[endpoint] = host
        what = "as here" if self._strict else "here it does not matter (--strict-baud: as on a real line)"
        log.warning(
            "%s %s: the host's port is set to %s, the controller's line has %s; a real line would garble each byte, %s",
            endpoint.kind,
            name_of(endpoint),
            host,
            line,
            what,
        )
