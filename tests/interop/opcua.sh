#!/usr/bin/env bash
# node-opcua reads the machine that `opcua` serves, and is told of an E-stop by a changed value and by an event.
set -euo pipefail
cd "$(mktemp -d)" && trap 'kill $(jobs -p) 2> /dev/null; wait; rm -rf "$PWD"' EXIT
npm install --silent --no-audit --no-fund node-opcua-client@2.186.4 || exit 3

cat > look.cjs <<'JS'
const { AttributeIds, OPCUAClient, constructEventFilter } = require("node-opcua-client");

async function main(endpoint) {
  const client = OPCUAClient.create({ endpointMustExist: false });
  await client.connect(endpoint);
  const session = await client.createSession();
  const index = (await session.read({ nodeId: "i=2255" })).value.value.indexOf("urn:isel-twin");
  const position = await session.read({ nodeId: `ns=${index};s=4030.Axes.X.ActualPosition` });
  console.log(position.statusCode.name, position.value.value);
  if (position.statusCode.name !== "Good") throw new Error("no position");

  const subscription = await session.createSubscription2({ requestedPublishingInterval: 100, publishingEnabled: true });
  const queue = { queueSize: 10, filter: constructEventFilter(["Message"]) };
  const alerts = await subscription.monitor({ nodeId: "i=2253", attributeId: AttributeIds.EventNotifier }, queue, 1);
  const alert = new Promise((resolve) => alerts.on("changed", ([message]) => {
    console.log(message.value.text);
    if (message.value.text === "the E-stop is pressed") resolve();
  }));
  const nodeId = `ns=${index};s=4030.Safety.EmergencyStop`;
  const stop = await subscription.monitor({ nodeId, attributeId: AttributeIds.Value }, { queueSize: 10 }, 1);
  const pressed = new Promise((resolve) => stop.on("changed", ({ value }) => {
    console.log(nodeId, value.value);
    if (value.value) resolve();
  }));
  console.log("ready");
  await Promise.all([alert, pressed]);
  await session.close(true);
  await client.disconnect();
}
main(process.argv[2]).catch((error) => { console.log(error); process.exitCode = 1; });
JS
said() { # the value of a word in the line that a server prints once it listens
  timeout 300 sh -c "until grep -qs '$2' $1; do sleep 0.2; done"
  sed -n "s/.*\"$2\": \"\([^\"]*\)\".*/\1/p" "$1"
}
isel-twin serve --tcp 127.0.0.1:0 --control 127.0.0.1:0 > served &
control="$(said served control)"
isel-twin opcua "$control" --tcp 127.0.0.1:0 > beside &
endpoint="$(said beside opcua)"
timeout 300 node look.cjs "$endpoint" > seen &
looks=$!
said seen ready
isel-twin ctl "$control" set estop=pressed
wait $looks || { cat seen; exit 1; }
cat seen
