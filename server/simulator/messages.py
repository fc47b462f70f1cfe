"""The car's readings as ROS 1 or ROS 2 messages, spelled as rosbridge spells them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from server.judge.message import Json, Message, RosVersion
from server.simulator.laser import RANGE_MAX_M, Beams

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """One topic of the car. `type` in ROS 1 spelling, `signal` as the topic table calls it."""

    topic: str
    type: str
    signal: str

    def ros_type(self, version: RosVersion) -> str:
        package, _, name = self.type.partition("/")
        return self.type if version == 1 else f"{package}/msg/{name}"


VEL = Published(topic="/catvehicle/vel", type="geometry_msgs/Twist", signal="speed")
BRAKE = Published(topic="/catvehicle/brake", type="geometry_msgs/Wrench", signal="brake")
ACCELERATOR = Published(topic="/catvehicle/accelerator", type="geometry_msgs/Wrench", signal="accelerator")
STEERING = Published(topic="/catvehicle/steering", type="geometry_msgs/Wrench", signal="steering")
CMD_VEL = Published(topic="/catvehicle/cmd_vel", type="geometry_msgs/Twist", signal="command")
DISTANCE = Published(topic="/DistanceEstimator/dist", type="std_msgs/Float32", signal="distance")
ANGLE = Published(topic="/DistanceEstimator/angle", type="std_msgs/Float32", signal="bearing")
GPS_FIX = Published(topic="/gps_fix", type="sensor_msgs/NavSatFix", signal="position")
GPS_ODOM = Published(topic="/gps_odom", type="nav_msgs/Odometry", signal="odometry")
SCAN = Published(topic="/catvehicle/front_laser_points", type="sensor_msgs/LaserScan", signal="scan")
DIAGNOSTICS = Published(topic="/diagnostics", type="diagnostic_msgs/DiagnosticArray", signal="diagnostics")
MODE = Published(topic="/catvehicle/control_mode", type="std_msgs/String", signal="mode")

PUBLISHED = (VEL, BRAKE, ACCELERATOR, STEERING, CMD_VEL, DISTANCE, ANGLE, GPS_FIX, GPS_ODOM, SCAN, DIAGNOSTICS, MODE)
SIGNAL_OF_TOPIC = {published.topic: published.signal for published in PUBLISHED}

Component = tuple[int, str, str, str, dict[str, str]]  # level, name, message, hardware id, values


class Writer:
    """Writes messages of one ROS version. `at_s` is the time of sending, `stamp_s` that of measuring [s since 1970]."""

    def __init__(self, version: RosVersion) -> None:
        self._version: RosVersion = version
        self._types = {published: published.ros_type(version) for published in PUBLISHED}
        self._sequence: Counter[str] = Counter()

    def twist(self, published: Published, at_s: float, speed_mps: float, turn: float = 0.0) -> Message:
        """A geometry_msgs/Twist: linear.x and angular.z, whatever the topic means by it."""
        return self._message(
            published, at_s, {"linear": _vector(speed_mps, 0.0, 0.0), "angular": _vector(0.0, 0.0, turn)}
        )

    def effort(self, published: Published, at_s: float, percent: float) -> Message:
        """A pedal: percent in force.x."""
        return self._message(published, at_s, {"force": _vector(percent, 0.0, 0.0), "torque": _vector(0.0, 0.0, 0.0)})

    def steering(self, at_s: float, percent: float) -> Message:
        """The steering wheel: percent in torque.z, negative to the left."""
        return self._message(STEERING, at_s, {"force": _vector(0.0, 0.0, 0.0), "torque": _vector(0.0, 0.0, percent)})

    def number(self, published: Published, at_s: float, value: float) -> Message:
        return self._message(published, at_s, {"data": value})

    def mode(self, at_s: float, mode: str) -> Message:
        """The driving mode."""
        return self._message(MODE, at_s, {"data": mode})

    def fix(self, at_s: float, stamp_s: float, lat_deg: float, lon_deg: float, alt_m: float) -> Message:
        """A NavSatFix as the real car's driver marks it: a fix, with a covariance of zeros called type 2."""
        return self._message(
            GPS_FIX,
            at_s,
            {
                "header": self._header(GPS_FIX, "/odom", stamp_s),
                "status": {"status": 0, "service": 1},
                "latitude": lat_deg,
                "longitude": lon_deg,
                "altitude": alt_m,
                "position_covariance": [0.0] * 9,
                "position_covariance_type": 2,
            },
        )

    def odometry(self, at_s: float, stamp_s: float, place_m: Vector, yaw_rad: float, velocity_mps: Vector) -> Message:
        """A nav_msgs/Odometry: place in UTM, velocity east, north and up, both in metres."""
        return self._message(
            GPS_ODOM,
            at_s,
            {
                "header": self._header(GPS_ODOM, "/odom", stamp_s),
                "child_frame_id": "base_link",
                "pose": {
                    "pose": {
                        "position": _vector(*place_m),
                        "orientation": {
                            "x": 0.0,
                            "y": 0.0,
                            "z": math.sin(yaw_rad / 2),
                            "w": math.cos(yaw_rad / 2),
                        },
                    },
                    "covariance": [0.0] * 36,
                },
                "twist": {
                    "twist": {"linear": _vector(*velocity_mps), "angular": _vector(0.0, 0.0, 0.0)},
                    "covariance": [0.0] * 36,
                },
            },
        )

    def scan(self, at_s: float, stamp_s: float, beams: Beams, ranges_m: npt.NDArray[np.float32]) -> Message:
        return self._message(
            SCAN,
            at_s,
            {
                "header": self._header(SCAN, "laser", stamp_s),
                "angle_min": beams.angle_min_rad,
                "angle_max": beams.angle_max_rad,
                "angle_increment": beams.increment_rad,
                "time_increment": beams.time_increment_s,
                "scan_time": beams.scan_time_s,
                "range_min": 0.0,
                "range_max": RANGE_MAX_M,
                "ranges": ranges_m,
                "intensities": [],
            },
        )

    def diagnostics(self, at_s: float, components: Sequence[Component]) -> Message:
        """A DiagnosticArray; levels are integers, as both versions of rosbridge send a `byte`."""
        return self._message(
            DIAGNOSTICS,
            at_s,
            {
                "header": self._header(DIAGNOSTICS, "", at_s),
                "status": [
                    {
                        "level": level,
                        "name": name,
                        "message": message,
                        "hardware_id": hardware_id,
                        "values": [{"key": key, "value": value} for key, value in values.items()],
                    }
                    for level, name, message, hardware_id, values in components
                ],
            },
        )

    def _message(self, published: Published, at_s: float, message: Json) -> Message:
        return Message(at_s=at_s, topic=published.topic, type=self._types[published], message=message)

    def _header(self, published: Published, frame_id: str, stamp_s: float) -> dict[str, Any]:
        seconds, nanoseconds = divmod(round(stamp_s * 1e9), 1_000_000_000)
        if self._version == 2:
            return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame_id}
        sequence = self._sequence[published.topic]
        self._sequence[published.topic] += 1
        return {"seq": sequence, "stamp": {"secs": seconds, "nsecs": nanoseconds}, "frame_id": frame_id}


def _vector(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}
