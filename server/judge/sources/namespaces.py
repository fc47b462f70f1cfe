"""Which topics belong to different cars on one bridge, by their namespaces."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping

from server.judge.frame_names import AHEAD_WORDS, ELSEWHERE_WORDS, name_parts

# Parts of the prefixes that sensors, estimators and components of one car have.
PART_WORDS = (
    AHEAD_WORDS
    | ELSEWHERE_WORDS
    | frozenset(
        {
            "lidar", "laser", "lasers", "scan", "scanner", "radar", "sonar", "velodyne", "ouster", "hesai", "livox",
            "sick", "hokuyo", "rplidar", "ydlidar", "camera", "cameras", "cam", "zed", "realsense", "stereo",
            "rgbd", "depth", "gps", "gnss", "navsat", "ublox", "novatel", "septentrio", "trimble", "oxts", "sbg",
            "xsens", "fix", "rtk", "imu", "ins", "ahrs", "compass", "mag", "wheel", "wheels", "encoder", "encoders",
            "odom", "odometry", "visual", "vio", "vo", "vins", "orb", "slam", "lio", "loam", "icp", "kiss", "rtabmap",
            "ekf", "ukf", "filter", "filtered", "fused", "fusion", "localization", "localisation", "estimation",
            "estimator", "ground", "truth", "gazebo", "sim", "amcl", "cartographer", "mapping", "perception", "sensing",
            "sensor", "sensors", "chassis", "base", "controller", "control", "drive", "diff", "dbw", "can", "top",
            "upper", "lower", "middle", "center", "centre", "main", "primary", "secondary", "backup", "raw", "mavros",
            "distanceestimator",
        }
    )
)  # fmt: skip
OWN = "vehicle"  # where drivers of a single car have its wheels and pedals
DRIVES = frozenset({"speed", "odometry", "command"})  # a car has one of each
MOST_LEVELS = 6
OF_A_ROBOT = frozenset({"sensor_msgs/NavSatFix", "nav_msgs/Odometry", "sensor_msgs/LaserScan", "sensor_msgs/Imu"})
ALIKE = 2  # so many kinds of topics that two namespaces have alike make them two robots


def competing(topics: Mapping[str, Collection[str]]) -> tuple[str, ...]:
    """The namespaces ("/agv1") of several cars, sorted; empty: all topics are of one. `topics`: signal → candidates.

    Two namespaces compete where the same signal is in both by the same rest of its name, unless the name is that of a
    sensor or another part of a car.
    """
    found: dict[tuple[str, str], set[str]] = defaultdict(set)
    every = {topic for group in topics.values() for topic in group}
    for signal, group in topics.items():
        for topic in group:
            parts = topic.strip("/").split("/")[:MOST_LEVELS]
            for level in range(1, len(parts)):
                is_part = parts[level - 1].lower() == OWN or not PART_WORDS.isdisjoint(name_parts(parts[level - 1]))
                if not is_part:
                    found[signal, "/".join(parts[level:])].add("/" + "/".join(parts[:level]))
    rivals: set[str] = set()
    for (signal, _), prefixes in found.items():
        if len(prefixes) > 1 and (signal in DRIVES or all(_count(prefix, every) > 1 for prefix in prefixes)):
            rivals |= prefixes
    outer = sorted(one for one in rivals if not any(is_within(one, other) for other in rivals))
    return tuple(outer) if len(outer) > 1 else ()


def is_within(topic: str, namespace: str) -> bool:
    """Whether a topic is in a namespace."""
    return topic.startswith(f"{namespace}/")


def namespace_of(topic: str, namespaces: Collection[str]) -> str | None:
    """Which of the namespaces a topic is in; None: in none."""
    return next((one for one in namespaces if is_within(topic, one)), None)


def _count(namespace: str, topics: Collection[str]) -> int:
    return sum(is_within(topic, namespace) for topic in topics)


def is_of_another_robot(topic: str, other: str, usable: Mapping[str, str]) -> bool:
    """Whether the namespaces of two topics hold several kinds of topics under the same names; names without one are
    alike. `usable`: topic → type in the spelling of ROS 1."""
    one, second = _root(topic), _root(other)
    if one == second:
        return False
    below_one, below_second = (
        {(name.lstrip("/")[len(root) :].lstrip("/"), kind) for name, kind in usable.items() if _root(name) == root}
        for root in (one, second)
    )
    return len({kind for _, kind in below_one & below_second if kind in OF_A_ROBOT}) >= ALIKE


def _root(topic: str) -> str:
    """The first part of a name with more than one, else nothing."""
    first, _, rest = topic.lstrip("/").partition("/")
    return first if rest else ""
