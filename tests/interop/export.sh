#!/usr/bin/env bash
# Samples of a recording are decoded by mcap-ros2-support, and what `export` makes of it by mcap-protobuf-support.
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check mcap-protobuf-support==0.6.0 mcap-ros2-support==0.6.0 || exit 3

printf '@07\n@0R7\n@0A1600,3000,0,30,0,30,0,30\n' > job.txt
isel-twin run job.txt --plant kinematic --record session.mcap > /dev/null
isel-twin export session.mcap view.mcap
venv/bin/python - <<'PY'
from collections import Counter

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_ros2.decoder import DecoderFactory as CdrDecoderFactory


def decoded(path, decoders):
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if decoder := decoders.decoder_for(channel.message_encoding, schema):
                yield decoder(message.data)


*_, last = decoded("session.mcap", CdrDecoderFactory())
print(last)
assert list(last.counts)[:3] == [1600, 0, 0]
seen = Counter(type(message).__name__ for message in decoded("view.mcap", DecoderFactory()))
print(dict(seen))
assert seen.keys() == {"SceneUpdate", "FrameTransforms", "Log"}
PY
