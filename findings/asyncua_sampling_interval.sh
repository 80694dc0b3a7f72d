#!/usr/bin/env bash
# asyncua's server answers Good to a sampling interval, and sends every change.
#
# Guess: a client that asks for a sampling interval of 1 s is told of at most one change in each second, or is told in the
#        answer (RevisedSamplingInterval) that it gets another.
# Seen:  the server answers Good, with the subscription's publishing interval (here 50 ms), and keeps neither: of 100
#        values written within some 0.5 s the client is told of 100.
# Here:  a twin's counters change a thousand times a second; a client that asked for little is flooded, and the server works
#        for it. The twin's OPC UA server bounds how often it writes, and says so in MinimumSamplingInterval.
# With:  asyncua 2.1.0, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check asyncua==2.1.0 || exit 3

venv/bin/python - <<'PY'
import asyncio
import logging
import socket
import sys
from importlib.metadata import version

from asyncua import Client, Server

logging.disable()
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    ADDRESS = f"opc.tcp://127.0.0.1:{free.getsockname()[1]}/"
WRITTEN = 100


class Changes:
    def __init__(self):
        self.values = []

    def datachange_notification(self, node, value, data):
        self.values.append(value)


async def main():
    server = Server()
    await server.init()
    server.set_endpoint(ADDRESS)
    counter = await server.nodes.objects.add_variable(await server.register_namespace("urn:machine"), "counter", 0.0)
    changes = Changes()
    async with server, Client(ADDRESS) as client:
        subscription = await client.create_subscription(50, changes)
        node = client.get_node(counter.nodeid)
        await subscription.subscribe_data_change(node, sampling_interval=1000, queuesize=2 * WRITTEN)
        while not changes.values:
            await asyncio.sleep(0.05)
        changes.values.clear()
        for value in range(WRITTEN):
            await counter.write_value(float(value + 1))
            await asyncio.sleep(0.005)
        await asyncio.sleep(0.5)
    print(f"asyncua {version('asyncua')}: sampling interval 1 s, {WRITTEN} values in about 0.5 s:", end=" ")
    print(f"told of {len(changes.values)}")
    return len(changes.values) != WRITTEN


sys.exit(asyncio.run(main()))
PY
