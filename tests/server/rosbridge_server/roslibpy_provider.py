"""Unmodified roslibpy that offers a service and publishes with its own header; arguments: port, version of ROS."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import roslibpy
import roslibpy.ros2


def main(port: int, version: int) -> None:
    ros = roslibpy.Ros("127.0.0.1", port, transport="asyncio")
    ros.run(timeout=20)

    def switch(request: Any, response: Any) -> bool:
        response["success"], response["message"] = request["data"], "lamp"
        return True

    roslibpy.Service(ros, "/lamp", "std_srvs/SetBool").advertise(switch)
    if version == 1:
        header = roslibpy.Header(seq=1, stamp=roslibpy.Time(3, 4), frame_id="gps")
    else:
        header = roslibpy.ros2.Header(stamp=roslibpy.ros2.Time(3, 4), frame_id="gps")
    topic = roslibpy.Topic(ros, "/point", "geometry_msgs/PointStamped")
    while True:  # until we are ended
        topic.publish(roslibpy.Message({"header": dict(header), "point": {"x": 1.0}}))
        time.sleep(0.05)


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]), int(sys.argv[2]))
    finally:
        os._exit(1)  # roslibpy's own way out can hang a process whose reactor thread still runs
