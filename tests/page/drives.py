"""Small drives written as ROS 1 bags, for a real bridge to replay: what a car says is chosen by the test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS1_NOETIC)
T = STORE.types
BEGAN_NS = 1_464_818_234 * 10**9
TOPICS = {
    "speed": ("/catvehicle/vel", "geometry_msgs/msg/Twist", 20),
    "distance": ("/catvehicle/distanceEstimator/dist", "std_msgs/msg/Float32", 20),
    "bearing": ("/catvehicle/distanceEstimator/angle", "std_msgs/msg/Float32", 20),
    "diagnostics": ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 2),
}


def vector(x: float) -> Any:
    return T["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0)


def twist(speed_mps: float) -> Any:
    return T["geometry_msgs/msg/Twist"](linear=vector(speed_mps), angular=vector(0.0))


def number(value: float) -> Any:
    return T["std_msgs/msg/Float32"](data=value)


def diagnostics(*components: tuple[str, int, str]) -> Any:
    stamp = T["builtin_interfaces/msg/Time"](sec=BEGAN_NS // 10**9, nanosec=0)
    rows = [
        T["diagnostic_msgs/msg/DiagnosticStatus"](level=level, name=name, message=text, hardware_id=name, values=[])
        for name, level, text in components
    ]
    header = T["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="")
    return T["diagnostic_msgs/msg/DiagnosticArray"](header=header, status=rows)


def write(path: Path, says: dict[str, Callable[[float], Any]], *, seconds: float = 10.0) -> Path:
    """A bag in which each named signal says what its function gives for the time since the start [s]."""
    with Writer(path) as bag:
        lines = {}
        for name in says:
            topic, kind, hz = TOPICS[name]
            lines[name] = (bag.add_connection(topic, kind, typestore=STORE), kind, hz)
        moments = sorted((i / hz, name) for name, (_, _, hz) in lines.items() for i in range(round(seconds * hz)))
        for at_s, name in moments:
            connection, kind, _ = lines[name]
            bag.write(connection, BEGAN_NS + round(at_s * 1e9), bytes(STORE.serialize_ros1(says[name](at_s), kind)))
    return path


def steady(path: Path, speed_mps: float) -> Path:
    """A car that drives at one speed, an object far ahead and 3° to the right."""
    return write(
        path,
        {
            "speed": lambda _: twist(speed_mps),
            "distance": lambda t: number(70.0 + 0.001 * np.sin(9 * t)),  # a value that never moves would be frozen
            "bearing": lambda t: number(-0.052 + 0.0001 * np.sin(7 * t)),
        },
    )
