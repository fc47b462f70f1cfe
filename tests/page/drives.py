"""Small drives written as ROS 1 bags, for a real bridge to replay: what a car sends is chosen by the test."""

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
    "steering": ("/catvehicle/steering", "geometry_msgs/msg/Wrench", 20),
    "scan": ("/catvehicle/front_laser_points", "sensor_msgs/msg/LaserScan", 20),
    "diagnostics": ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 2),
}


def vector(x: float) -> Any:
    return T["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0)


def twist(speed_mps: float) -> Any:
    return T["geometry_msgs/msg/Twist"](linear=vector(speed_mps), angular=vector(0.0))


def number(value: float) -> Any:
    return T["std_msgs/msg/Float32"](data=value)


def steering(tyre_rad: float) -> Any:
    """As the simulated car sends it, which such topics are taken for: the tyres' angle, positive = left."""
    return T["geometry_msgs/msg/Wrench"](
        force=vector(0.0), torque=T["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=tyre_rad)
    )


def laser(at_s: float, ranges_m: Any, angle_min: float = -np.pi / 2, increment: float | None = None) -> Any:
    """A scan `at_s` after the start; its beams stand evenly over half a turn from the right by default."""
    ranges = np.asarray(ranges_m, dtype=np.float32)
    step = np.pi / max(ranges.size - 1, 1) if increment is None else increment
    sec, nanosec = divmod(BEGAN_NS + round(at_s * 1e9), 10**9)
    stamp = T["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return T["sensor_msgs/msg/LaserScan"](
        header=T["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="laser"),
        angle_min=angle_min,
        angle_max=angle_min + step * (ranges.size - 1),
        angle_increment=step,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.1,
        range_max=81.0,
        ranges=ranges,
        intensities=np.empty(0, dtype=np.float32),
    )


def street(at_s: float, beams: int = 181, *, gap_m: float = 12.0) -> Any:
    """Two walls 6 m aside, something 1 m wide `gap_m` ahead, one sector without a return, whatever the beams."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, beams)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(6.0 / np.abs(np.sin(angles)), 60.0)
    ranges[np.abs(gap_m * np.tan(angles)) < 0.5] = gap_m
    ranges[(angles < -1.0) & (angles > -1.25)] = np.nan
    return laser(at_s, ranges + 0.02 * np.sin(37 * angles + at_s))


def diagnostics(*components: tuple[str, int, str]) -> Any:
    stamp = T["builtin_interfaces/msg/Time"](sec=BEGAN_NS // 10**9, nanosec=0)
    rows = [
        T["diagnostic_msgs/msg/DiagnosticStatus"](level=level, name=name, message=text, hardware_id=name, values=[])
        for name, level, text in components
    ]
    header = T["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="")
    return T["diagnostic_msgs/msg/DiagnosticArray"](header=header, status=rows)


def write(path: Path, signals: dict[str, Callable[[float], Any]], *, seconds: float = 10.0) -> Path:
    """A bag in which each named signal has what its function gives for the time since the start [s]; where it
    gives None, the signal is silent."""
    with Writer(path) as bag:
        lines = {}
        for name in signals:
            topic, kind, hz = TOPICS[name]
            lines[name] = (bag.add_connection(topic, kind, typestore=STORE), kind, hz)
        moments = sorted((i / hz, name) for name, (_, _, hz) in lines.items() for i in range(round(seconds * hz)))
        for at_s, name in moments:
            connection, kind, _ = lines[name]
            message = signals[name](at_s)
            if message is not None:
                bag.write(connection, BEGAN_NS + round(at_s * 1e9), bytes(STORE.serialize_ros1(message, kind)))
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
