#!/bin/sh
# roslibpy 2.1.0 (PyPI).
#
# What a good engineer would guess: with `reconnect_on_close` (the default), a `Topic` that both subscribes and
# advertises does both again after the connection was lost and is back.
#
# What is seen: the object keeps a single message for that, the one it sent last. Subscribed first and advertised then,
# it sends only `advertise` again: the subscription is gone for good, and `is_subscribed` is still True. A second
# `subscribe()` does nothing, because the object holds itself for subscribed. Two objects, one for each direction, are
# both restored.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check roslibpy==2.1.0 websockets==17.4 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import json
import os
import queue
import threading
from importlib.metadata import version

import roslibpy
from websockets.sync.server import serve

received = queue.Queue()  # (number of the connection, operation, topic)
connections = queue.Queue()
count = 0


def bridge(connection):
    """The part of a rosbridge that is needed here: it notes what each connection is sent."""
    global count
    count += 1
    number = count
    connections.put(connection)
    for text in connection:
        message = json.loads(text)
        received.put((number, message["op"], message["topic"]))


def take(size):
    return sorted(received.get(timeout=30) for _ in range(size))


server = serve(bridge, "127.0.0.1", 0)
threading.Thread(target=server.serve_forever, daemon=True).start()
ros = roslibpy.Ros("127.0.0.1", server.socket.getsockname()[1])
ros.run(timeout=10)

both = roslibpy.Topic(ros, "/both", "std_msgs/Float64")
both.subscribe(lambda message: None)
both.advertise()
listener, speaker = (roslibpy.Topic(ros, "/apart", "std_msgs/Float64") for _ in range(2))
listener.subscribe(lambda message: None)
speaker.advertise()
before = take(4)

connections.get(timeout=10).close()
connections.get(timeout=30)  # the client dials again by itself
after = take(3)
try:
    after.append(received.get(timeout=5))
except queue.Empty:
    pass

print(f"roslibpy {version('roslibpy')}")
print(f"  first connection:  {[(op, topic) for _, op, topic in before]}")
print(f"  second connection: {[(op, topic) for _, op, topic in after]}")
print(f"  is_subscribed of the object with both: {both.is_subscribed}")
holds = after == [(2, "advertise", "/apart"), (2, "advertise", "/both"), (2, "subscribe", "/apart")] and both.is_subscribed
print("The behaviour holds." if holds else "The behaviour has changed.", flush=True)
os._exit(0 if holds else 1)  # the reactor's thread does not end by itself
PYTHON

status=0
timeout 120 "$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
