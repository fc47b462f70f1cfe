"""Which of a car's topics are recorded beside those that are judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal

from server.recording.own import PREFIX
from server.topics import plain_type

Also = Literal["none", "light", "all"]

MAX_OTHERS = 500  # subscriptions cost the bridge a thread each
QUEUE_LENGTH = 50  # messages the bridge keeps for us in a burst

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
    offered: Mapping[str, str], *, without: Collection[str], also: Also, asked: Collection[str]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Topic → type of what is to be subscribed to besides, and the topics that are left out.

    A topic waits until the definition of its type was `asked` for. Our own names are nobody else's in a recording.
    """
    others: dict[str, str] = {}
    left_out: list[str] = []
    for topic, kind in sorted(offered.items()):
        if topic in without or also == "none":
            continue
        is_bulky = also == "light" and plain_type(kind) in BULKY
        if is_bulky or topic.startswith(PREFIX) or len(others) >= MAX_OTHERS:
            left_out.append(topic)
        elif not kind or kind in asked:
            others[topic] = kind
    return others, tuple(left_out)
