#!/bin/sh
# roslibpy 2.1.0 (PyPI).
#
# What a good engineer would guess: two `Topic` objects of one name are two subscriptions. `unsubscribe()` of one ends
# its own callback, and the other one goes on receiving.
#
# What is seen: `unsubscribe()` removes every callback of that topic name from the connection. The other object gets no
# further message, although the bridge still sends it and its `is_subscribed` is still True. No error, no log line.
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
import sys
import threading
from importlib.metadata import version

import roslibpy
from websockets.sync.server import serve

received = queue.Queue()  # what the client sends
connections = queue.Queue()


def bridge(connection):
    """The part of a rosbridge that is needed here: it notes operations, and sends what the test gives it."""
    connections.put(connection)
    for text in connection:
        received.put(json.loads(text))


server = serve(bridge, "127.0.0.1", 0)
threading.Thread(target=server.serve_forever, daemon=True).start()
ros = roslibpy.Ros("127.0.0.1", server.socket.getsockname()[1])
ros.run(timeout=10)
connection = connections.get(timeout=10)
published = threading.Event()


def publish(value):
    """Send one message of /speed and a second of /end, and wait for the second."""
    published.clear()
    connection.send(json.dumps({"op": "publish", "topic": "/speed", "msg": {"data": value}}))
    connection.send(json.dumps({"op": "publish", "topic": "/end", "msg": {"data": value}}))
    assert published.wait(10)


first, second, end = (roslibpy.Topic(ros, name, "std_msgs/Float64") for name in ("/speed", "/speed", "/end"))
of_first, of_second = [], []
first.subscribe(lambda message: of_first.append(message["data"]))
second.subscribe(lambda message: of_second.append(message["data"]))
end.subscribe(lambda message: published.set())
operations = [received.get(timeout=10)["op"] for _ in range(3)]

publish(1.0)
first.unsubscribe()
operations.append(received.get(timeout=10)["op"])
publish(2.0)

print(f"roslibpy {version('roslibpy')}")
print(f"  the bridge was sent: {operations}")
print(f"  first object received  {of_first}, is_subscribed {first.is_subscribed}")
print(f"  second object received {of_second}, is_subscribed {second.is_subscribed}")
holds = of_first == [1.0] and of_second == [1.0] and second.is_subscribed
print("The behaviour holds." if holds else "The behaviour has changed.", flush=True)
os._exit(0 if holds else 1)  # the reactor's thread does not end by itself
PYTHON

status=0
timeout 60 "$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
