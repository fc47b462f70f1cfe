"""Unmodified roslibpy in a process of its own: python roslibpy_client.py TRANSPORT PORT prints what it got as JSON."""

from __future__ import annotations

import json
import logging
import sys
import threading
import time
from typing import Any

import roslibpy

SCANS, VELOCITIES = 5, 20


def main(transport: str, port: int) -> dict[str, Any]:
    complaints: list[str] = []

    class Listen(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            complaints.append(record.getMessage())

    logging.getLogger("roslibpy").addHandler(Listen(level=logging.WARNING))
    ros = roslibpy.Ros("127.0.0.1", port, transport=transport)
    ros.run(timeout=10)
    velocities: list[Any] = []
    scans: list[Any] = []
    echoes: list[Any] = []
    roslibpy.Topic(ros, "/vel", "geometry_msgs/Twist", queue_length=1).subscribe(velocities.append)
    roslibpy.Topic(ros, "/scan", "sensor_msgs/LaserScan", throttle_rate=1).subscribe(scans.append)
    roslibpy.Topic(ros, "/echo", "std_msgs/String").subscribe(echoes.append)
    command = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")
    command.advertise()
    command.publish(roslibpy.Message({"linear": {"x": 1.5}}))
    wait_for(lambda: len(velocities) >= VELOCITIES and len(scans) >= SCANS and echoes)
    failures: list[Any] = []
    failed = threading.Event()
    roslibpy.Service(ros, "/rosapi/not_there", "rosapi/GetParam").call(
        roslibpy.ServiceRequest({"name": "/x"}),
        lambda _: failed.set(),
        lambda why: (failures.append(why), failed.set()),
    )
    failed.wait(5)
    result = {
        "velocities": [message["linear"]["x"] for message in velocities],
        "scan": scans[0],
        "echo": echoes[0],
        "topics": sorted(ros.get_topics()),
        "type": ros.get_topic_type("/scan"),
        "time": ros.get_time().to_sec(),
        "nodes": ros.get_nodes(),
        "services": "/rosapi/topics" in ros.get_services(),
        "details": ros.get_message_details("geometry_msgs/Twist")["typedefs"][0]["fieldnames"],
        "sum": roslibpy.Service(ros, "/add", "demo/Add").call(roslibpy.ServiceRequest({"a": 2, "b": 3}))["sum"],
        "failures": [str(why) for why in failures],
        "complaints": complaints,
    }
    ros.close()
    return result


def wait_for(condition: Any) -> None:
    ends = time.monotonic() + 10
    while not condition():
        if time.monotonic() > ends:
            raise TimeoutError("the bridge did not send what was expected")
        time.sleep(0.01)


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], int(sys.argv[2]))), flush=True)
    sys.stdout.flush()
    import os

    os._exit(0)  # roslibpy's own way out can hang a process whose reactor thread still runs
