"""A bridge that sends what its input names, as a process of its own: `python -m tests.server.security.heavy_bridge`.

Prints its port, and to how many each message went. It publishes speed at 20 Hz on /catvehicle/vel, and a large message
each time a line with a name of `MESSAGES` comes on its input, to all subscribers of its topic.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

import cbor2
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from server.rosbridge.codec import MAX_CONTAINERS, MAX_ELEMENTS, MAX_SLOW_ELEMENTS

OTHER, JUDGED = "/heavy", "/diagnostics"
TOPICS = {
    "/catvehicle/vel": "geometry_msgs/Twist",
    OTHER: "my_msgs/Heavy",
    JUDGED: "diagnostic_msgs/DiagnosticArray",
}


def _json(topic: str, body: str) -> str:
    return f'{{"op": "publish", "topic": "{topic}", "msg": {{"items": {body}}}}}'


def _cbor(topic: str, body: bytes) -> bytes:
    return b"\xa3" + b"".join(cbor2.dumps(text) for text in ("op", "publish", "topic", topic, "msg")) + body


PARTS, ELEMENTS, SLOW = MAX_CONTAINERS + 1, MAX_ELEMENTS + 2, MAX_SLOW_ELEMENTS + 2
MESSAGES = {  # a little beyond a bound
    "objects": lambda topic: _json(topic, "[" + ",".join(['{"a":1.5}'] * PARTS) + "]"),
    "nests": lambda topic: _json(topic, "[" + ",".join(["[[[[[]]]]]"] * (PARTS // 5 + 1)) + "]"),
    "numbers": lambda topic: _json(topic, "[" + ",".join(["1.25"] * ELEMENTS) + "]"),
    "texts": lambda topic: _json(topic, "[" + ",".join(['"a"'] * ELEMENTS) + "]"),
    "nan": lambda topic: _json(topic, "[" + ",".join(["NaN"] * SLOW) + "]"),
    "cbor lists": lambda topic: _cbor(topic, cbor2.dumps({"a": [[]] * PARTS})),
    "cbor tags": lambda topic: _cbor(topic, cbor2.dumps({"a": [cbor2.CBORTag(85, b"")] * SLOW})),
    "cbor cut off": lambda topic: _cbor(topic, cbor2.dumps({"a": [0.5] * 1000})[:-1]),
}


class Bridge:
    """What is sent, to whom."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.subscribers: list[tuple[ServerConnection, str]] = []

    def answer(self, socket: ServerConnection) -> None:
        try:
            for raw in socket:
                operation = json.loads(raw)
                match operation["op"]:
                    case "subscribe":
                        with self.lock:
                            self.subscribers.append((socket, operation["topic"]))
                    case "call_service":
                        reply = {"op": "service_response", "id": operation.get("id"), "service": operation["service"]}
                        values = _values(operation["service"])
                        self.send(socket, json.dumps(reply | {"values": values, "result": values is not None}))
        except ConnectionClosed:
            pass

    def send(self, socket: ServerConnection, frame: str | bytes) -> None:
        try:
            socket.send(frame)
        except ConnectionClosed:
            with self.lock:
                self.subscribers = [row for row in self.subscribers if row[0] is not socket]

    def publish(self, topic: str, frame: str | bytes) -> int:
        """To how many."""
        with self.lock:
            to = [socket for socket, subscribed in self.subscribers if subscribed == topic]
        for socket in to:
            self.send(socket, frame)
        return len(to)

    def drive(self) -> None:
        zero = {"x": 0.0, "y": 0.0, "z": 0.0}
        while True:
            message = {"linear": zero | {"x": 3.0 + time.time() % 1.0}, "angular": zero}
            self.publish("/catvehicle/vel", json.dumps({"op": "publish", "topic": "/catvehicle/vel", "msg": message}))
            time.sleep(0.05)


def _values(service: str) -> dict[str, Any] | None:
    match service:
        case "/rosapi/topics":
            return {"topics": list(TOPICS), "types": list(TOPICS.values())}
        case "/rosapi/get_time":
            return {"time": {"secs": 1, "nsecs": 0}}
        case "/rosapi/publishers":
            return {"publishers": ["/car"]}
    return None


def main() -> None:
    bridge = Bridge()
    with serve(bridge.answer, "127.0.0.1", 0, max_size=None, compression=None) as server:
        print(server.socket.getsockname()[1], flush=True)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        threading.Thread(target=bridge.drive, daemon=True).start()
        for line in sys.stdin:
            name, _, topic = line.strip().partition(" on ")
            print(bridge.publish(topic, MESSAGES[name](topic)), flush=True)


if __name__ == "__main__":
    main()
