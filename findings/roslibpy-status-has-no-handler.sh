#!/bin/sh
# roslibpy 2.1.0 (PyPI).
#
# What a good engineer would guess: a `status` message of the rosbridge protocol (3.2.2: "error", "warning", "info", with
# the id of the operation) reaches the program in some way: an event, a callback, a log line with its text.
#
# What is seen: the library knows the operation and has no handler for it. It raises inside, logs "No handler registered
# for operation "status"" with "It could indicate a bug in user code on message handlers", and drops the message: its
# text is in no log line and no event. A server that tells an error only by `status` tells it to nobody here.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check roslibpy==2.1.0 websockets==17.4 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import json
import logging
import os
import queue
import threading
from importlib.metadata import version

import roslibpy
from websockets.sync.server import serve

connections = queue.Queue()
WHY = "subscribe: /speed has the type std_msgs/Float64, not std_msgs/String"


def bridge(connection):
    connections.put(connection)
    for _ in connection:
        pass


class Keep(logging.Handler):
    lines = []

    def emit(self, record):
        self.lines.append(record.getMessage() + (repr(record.exc_info[1]) if record.exc_info else ""))


logging.getLogger().addHandler(Keep())
server = serve(bridge, "127.0.0.1", 0)
threading.Thread(target=server.serve_forever, daemon=True).start()
ros = roslibpy.Ros("127.0.0.1", server.socket.getsockname()[1])
ros.run(timeout=10)
events = []
ros.on("status", events.append)
after = threading.Event()
roslibpy.Topic(ros, "/end", "std_msgs/String").subscribe(lambda message: after.set())
connection = connections.get(timeout=10)
connection.send(json.dumps({"op": "status", "level": "error", "msg": WHY, "id": "subscribe:/speed:1"}))
connection.send(json.dumps({"op": "publish", "topic": "/end", "msg": {"data": ""}}))
assert after.wait(10)

told = [line for line in Keep.lines if WHY in line]
unhandled = [line for line in Keep.lines if "No handler registered" in line]
print(f"roslibpy {version('roslibpy')}")
print(f"  events: {events}")
print(f"  log lines with the text of the status: {len(told)}")
print(f"  log lines about a missing handler: {unhandled}")
holds = not events and not told and len(unhandled) == 1
print("The behaviour holds." if holds else "The behaviour has changed.", flush=True)
os._exit(0 if holds else 1)  # the reactor's thread does not end by itself
PYTHON

status=0
timeout 60 "$folder/venv/bin/python" "$folder/try.py" 2> "$folder/err" || status=$?
[ "$status" -le 1 ] || cat "$folder/err"
exit "$status"
