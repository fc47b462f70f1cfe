"""The encodings that players and older clients ask for: the bytes of the ROS message, and a picture of the JSON."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from typing import Any

import numpy as np
import orjson
import pytest
from rosbags.typesys import Stores, get_typestore

from server.judge.message import RosVersion
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, probing

pytestmark = pytest.mark.virtual_time

TWIST = {"linear": {"x": 1.0, "y": 2.0, "z": 3.0}, "angular": {"x": 4.0, "y": 5.0, "z": 6.0}}
SIX = struct.pack("<6d", 1, 2, 3, 4, 5, 6)
CDR = b"\x00\x01\x00\x00"  # little endian


@pytest.mark.parametrize(("version", "expected"), [(1, SIX), (2, CDR + SIX)])
async def test_raw_bytes_are_those_between_nodes(version: RosVersion, expected: bytes) -> None:
    async with bridging(ros_version=version, now=lambda: 1_700_000_000.25) as (bridge, port), probing(port) as probe:
        bridge.advertise("/vel", "geometry_msgs/Twist")
        await probe.subscribe("/vel", compression="cbor-raw")
        bridge.publish("/vel", TWIST)
        assert await probe.hear() == {
            "op": "publish",
            "topic": "/vel",
            "msg": {"secs": 1_700_000_000, "nsecs": 250_000_000, "bytes": expected},  # these names in both versions
        }


@pytest.mark.parametrize("version", [1, 2])
async def test_a_scan_arrives_whole(version: RosVersion) -> None:
    stamp = {"secs": 5, "nsecs": 6} if version == 1 else {"sec": 5, "nanosec": 6}
    header = {"stamp": stamp, "frame_id": "front_laser"} | ({"seq": 7} if version == 1 else {})
    ranges = np.array([1.5, np.inf, np.nan], dtype=np.float32)
    async with bridging(ros_version=version) as (bridge, port), probing(port) as probe:
        bridge.advertise("/scan", "sensor_msgs/LaserScan")
        await probe.subscribe("/scan", compression="cbor-raw")
        bridge.publish("/scan", {"header": header, "angle_min": -1.0, "ranges": ranges})
        data = (await probe.hear())["msg"]["bytes"]
    if version == 1:
        read = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(data, "sensor_msgs/msg/LaserScan")
    else:
        read = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(data, "sensor_msgs/msg/LaserScan")
    scan: Any = read
    assert (scan.header.stamp.sec, scan.header.stamp.nanosec, scan.header.frame_id) == (5, 6, "front_laser")
    assert np.array_equal(scan.ranges, ranges, equal_nan=True)
    assert (scan.angle_min, scan.range_max, len(scan.intensities)) == (-1.0, 0.0, 0)


async def test_a_png_holds_the_json(bridge: RosBridge, probe: Probe) -> None:
    bridge.advertise("/vel", "geometry_msgs/Twist")
    await probe.subscribe("/vel", compression="png")
    bridge.publish("/vel", {**TWIST, "linear": {"x": math.nan, "y": 2.0, "z": 3.0}})
    received = await probe.hear()
    assert set(received) == {"op", "data"}
    assert received["op"] == "png"
    assert orjson.loads(pixels(base64.b64decode(received["data"]))) == {
        "op": "publish",
        "topic": "/vel",
        "msg": {**TWIST, "linear": {"x": None, "y": 2.0, "z": 3.0}},
    }


async def test_the_strongest_encoding_of_a_client_wins(bridge: RosBridge, probe: Probe) -> None:
    """As on a real bridge: raw before CBOR before a picture before JSON."""
    bridge.advertise("/vel", "geometry_msgs/Twist")
    for compression, found in (("none", "msg"), ("png", "data"), ("cbor", "linear"), ("cbor-raw", "bytes")):
        await probe.subscribe("/vel", id=compression, compression=compression)
        bridge.publish("/vel", TWIST)
        received = await probe.hear()
        assert found in received or found in received["msg"]


async def test_what_has_no_raw_bytes_is_told_once(bridge: RosBridge, probe: Probe) -> None:
    """A type without a definition, and a message that is not of its type: JSON passes both on."""
    bridge.advertise("/odd", "my_msgs/Odd")
    await probe.subscribe("/odd", compression="cbor-raw")
    for _ in range(3):
        bridge.publish("/odd", {"x": 1})
    received = await probe.hear()
    assert (received["op"], received["level"]) == ("status", "error")
    assert received["msg"] == "subscribe: /odd cannot be sent as cbor-raw: the type my_msgs/Odd is not known"
    assert await probe.hears_nothing()
    await probe.send(op="unsubscribe", topic="/odd")
    await probe.subscribe("/odd")
    bridge.publish("/odd", {"x": 1})
    assert (await probe.hear())["msg"] == {"x": 1}


def pixels(picture: bytes) -> bytes:
    """The bytes of an RGB picture whose lines are stored as they are; W3C PNG, 11.2."""
    assert picture.startswith(b"\x89PNG\r\n\x1a\n")
    at, data, width = 8, b"", 0
    while at < len(picture):
        (size,), name = struct.unpack(">I", picture[at : at + 4]), picture[at + 4 : at + 8]
        body = picture[at + 8 : at + 8 + size]
        assert zlib.crc32(name + body) == struct.unpack(">I", picture[at + 8 + size : at + 12 + size])[0]
        if name == b"IHDR":
            width, _, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 2)
        elif name == b"IDAT":
            data += body
        at += 12 + size
    rows = zlib.decompress(data)
    line = 1 + 3 * width
    assert all(rows[start] == 0 for start in range(0, len(rows), line))  # no filter
    return b"".join(rows[start + 1 : start + line] for start in range(0, len(rows), line)).rstrip(b"\n")
