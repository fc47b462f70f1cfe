"""Which of a car's topics are recorded beside those that are judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Literal

from server.judge.topics import plain_type
from server.protocol.recording_state import MissingTopics
from server.recording.own import PREFIX
from server.rosbridge.outgoing import is_topic, is_type
from server.system.clean_text import clean

Also = Literal["none", "light", "all"]

MAX_OTHERS = 500  # subscriptions cost the bridge a thread each
MOST_NAMED = 20
MOST_WRITTEN = 500  # names in a file, where they may stand several times
LONGEST_NAME = 255  # letters; ROS 2 allows no more
QUEUE_LENGTH = 50  # messages the bridge keeps for us in a burst


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """Topics of a car that are not, or not wholly, in its recording."""

    left_out: tuple[str, ...] = ()  # not subscribed to: bulky, or too many
    not_received: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # → the nodes that publish them
    too_large: Mapping[str, int] = field(default_factory=dict)  # → bytes of a message; not subscribed to any more

    def as_json(self) -> MissingTopics:
        """For the state, ten times a second to every page: at most MOST_NAMED of each, each at most LONGEST_NAME, and
        how many there are."""
        return {
            "left_out_count": len(self.left_out) + len(self.too_large),
            "not_received_count": len(self.not_received),
            "too_large_count": len(self.too_large),
            "left_out": [_short(topic) for topic in [*self.left_out, *self.too_large][:MOST_NAMED]],
            "not_received": [_short(topic) for topic in [*self.not_received][:MOST_NAMED]],
            "too_large": [
                {"topic": _short(topic), "mb": round(size / 2**20, 1)}
                for topic, size in [*self.too_large.items()][:MOST_NAMED]
            ],
        }

    def as_metadata(self) -> dict[str, str]:
        """For the file: a line each, at most MOST_WRITTEN of them, and how many there are."""
        left_out = [*self.left_out, *self.too_large]
        return {
            "left_out": "\n".join(map(_short, left_out[:MOST_WRITTEN])),
            "left_out_count": str(len(left_out)),
            "not_received": "\n".join(map(_short, [*self.not_received][:MOST_WRITTEN])),
            "not_received_count": str(len(self.not_received)),
        }


def _short(topic: str) -> str:
    """A topic's name as a car gives it, which may be any text: one line of it."""
    return clean(topic, LONGEST_NAME)


# Types of messages that come when something happens, which may be never: that none came is no news.
EVENTS = frozenset(
    {
        "actionlib_msgs/GoalID",
        "dynamic_reconfigure/Config",
        "dynamic_reconfigure/ConfigDescription",
        "lifecycle_msgs/TransitionEvent",
        "rcl_interfaces/Log",
        "rcl_interfaces/ParameterEvent",
        "rosgraph_msgs/Log",
        "std_msgs/Empty",
    }
)

# Types whose messages are so large that they would fill the car's radio and the disk.
BULKY = frozenset(
    {
        "sensor_msgs/Image",
        "sensor_msgs/CompressedImage",
        "sensor_msgs/PointCloud",
        "sensor_msgs/PointCloud2",
        "sensor_msgs/MultiEchoLaserScan",
        "stereo_msgs/DisparityImage",
        "theora_image_transport/Packet",
        "ffmpeg_image_transport_msgs/FFMPEGPacket",
        "velodyne_msgs/VelodyneScan",
        "ouster_ros/PacketMsg",
        "nav_msgs/OccupancyGrid",
        "grid_map_msgs/GridMap",
        "octomap_msgs/Octomap",
        "pcl_msgs/PolygonMesh",
        "visualization_msgs/MarkerArray",
    }
)


def choose(
    offered: Mapping[str, str], *, without: Collection[str], also: Also, requested: Collection[str]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Topic → type of the topics that are only recorded, and the topics that are left out.

    A topic waits until the definition of its type has been `requested`. Our own names are reserved in a recording, and
    names that are not valid in ROS are not sent to a bridge.
    """
    others: dict[str, str] = {}
    left_out: list[str] = []
    for topic, kind in sorted(offered.items()):
        if topic in without or also == "none":
            continue
        is_bulky = also == "light" and plain_type(kind) in BULKY
        if (
            is_bulky
            or not is_topic(topic)
            or (kind and not is_type(kind))
            or topic.startswith(PREFIX)
            or len(others) >= MAX_OTHERS
        ):
            left_out.append(topic)
        elif not kind or kind in requested:
            others[topic] = kind
    return others, tuple(left_out)
