"""roslibpy at a rosbridge: every topic as JSON, until it closes. `python roslibpy_listener.py PORT` prints, as JSON, of
each topic its type, how many messages came, the first three and the last."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

import roslibpy

FIRST = 3


def main(port: int) -> dict[str, Any]:
    ros = roslibpy.Ros("127.0.0.1", port)
    closed = threading.Event()
    ros.run(timeout=30)
    ros.on("close", lambda *_: closed.set())
    seen: dict[str, Any] = {}
    for name in ros.get_topics():
        seen[name] = {"type": ros.get_topic_type(name), "count": 0, "first": [], "last": None}
    for name, row in seen.items():
        roslibpy.Topic(ros, name, row["type"], reconnect_on_close=False).subscribe(_into(row))
    closed.wait()
    return {"topics": seen, "statuses": []}


def _into(row: dict[str, Any]) -> Callable[[Any], None]:
    def note(message: Any) -> None:
        row["count"] += 1
        row["last"] = message
        if len(row["first"]) < FIRST:
            row["first"].append(message)

    return note


if __name__ == "__main__":
    print(json.dumps(main(int(sys.argv[1]))), flush=True)
    os._exit(0)  # roslibpy's own way out can hang a process whose reactor thread still runs
