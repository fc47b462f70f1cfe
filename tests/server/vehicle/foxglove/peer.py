"""A real server of foxglove-sdk as a car, with messages in each encoding that is read."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import foxglove
import orjson
from foxglove.websocket import Capability, Client, ClientChannel, ServerListener

from server.judge.message import RosVersion
from server.recording.read.schemas import TypeBook
from tests.ports import free_port

ODOMETRY, FIX = "nav_msgs/Odometry", "sensor_msgs/NavSatFix"
SCAN, TWIST = "sensor_msgs/LaserScan", "geometry_msgs/Twist"
ZEROS_9, ZEROS_36 = [0.0] * 9, [0.0] * 36
FREED_WITHIN_S = 10.0
XYZ = {"x": 0.0, "y": 0.0, "z": 0.0}


def header(version: RosVersion, stamp_ns: int) -> dict[str, Any]:
    seconds, rest = divmod(stamp_ns, 10**9)
    if version == 1:
        return {"seq": 0, "stamp": {"secs": seconds, "nsecs": rest}, "frame_id": "base"}
    return {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": "base"}


def odometry(version: RosVersion, speed_mps: float, stamp_ns: int) -> dict[str, Any]:
    return {
        "header": header(version, stamp_ns),
        "child_frame_id": "base_link",
        "pose": {"pose": {"position": XYZ, "orientation": {**XYZ, "w": 1.0}}, "covariance": ZEROS_36},
        "twist": {"twist": {"linear": {**XYZ, "x": speed_mps}, "angular": XYZ}, "covariance": ZEROS_36},
    }


def fix(version: RosVersion, stamp_ns: int) -> dict[str, Any]:
    return {
        "header": header(version, stamp_ns),
        "status": {"status": 0, "service": 1},
        "latitude": 32.2,
        "longitude": -110.9,
        "altitude": 700.0,
        "position_covariance": ZEROS_9,
        "position_covariance_type": 0,
    }


def scan(version: RosVersion, stamp_ns: int, beams: int = 720) -> dict[str, Any]:
    return {
        "header": header(version, stamp_ns),
        "angle_min": -1.5,
        "angle_max": 1.5,
        "angle_increment": 3.0 / (beams - 1),
        "time_increment": 0.0,
        "scan_time": 0.025,
        "range_min": 0.0,
        "range_max": 80.0,
        "ranges": [20.0 + one / 100 for one in range(beams)],
        "intensities": [],
    }


class Listener(ServerListener):
    """Writes down what clients publish."""

    def __init__(self) -> None:
        self.advertised: list[tuple[str, str, str]] = []  # topic, encoding, type
        self.received: list[tuple[str, bytes]] = []
        self.ended: list[str] = []

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        self.advertised.append((channel.topic, channel.encoding, channel.schema_name))

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        self.ended.append(str(client_channel_id))

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        self.received.append((str(client_channel_id), data))


class Peer:
    """`capabilities`, `encodings` and `most_queued` messages are those of the server; channels live as long as this."""

    def __init__(
        self,
        capabilities: Sequence[Capability] = (),
        encodings: Sequence[str] | None = None,
        most_queued: int | None = None,
    ) -> None:
        self.context = foxglove.Context()
        self.listener = Listener()
        self._options: dict[str, Any] = {
            "capabilities": list(capabilities),
            "supported_encodings": encodings,
            "message_backlog_size": most_queued,
        }
        self._channels: dict[str, tuple[foxglove.Channel, Any]] = {}
        self.port = free_port()
        self.start()

    def start(self) -> None:
        """Listens, on the same port as before, which a server that was stopped frees a moment later."""
        ends_s = time.monotonic() + FREED_WITHIN_S
        while True:
            try:
                self.server = foxglove.start_server(
                    name="peer", port=self.port, context=self.context, server_listener=self.listener, **self._options
                )
            except RuntimeError:
                if time.monotonic() > ends_s:
                    raise
                time.sleep(0.05)
            else:
                return

    def stop(self) -> None:
        self.server.stop()

    @property
    def address(self) -> str:
        return f"foxglove://127.0.0.1:{self.port}"

    def offer(self, topic: str, type: str, encoding: str) -> None:
        """A channel of this topic, in place of an earlier one."""
        self.end(topic)
        if encoding == "json":
            schema = foxglove.Schema(name=type, encoding="jsonschema", data=b'{"type":"object"}')
            self._channels[topic] = self._channel(topic, encoding, schema), orjson.dumps
            return
        known = TypeBook(1 if encoding == "ros1" else 2).schema(type)
        assert known is not None
        schema = foxglove.Schema(name=known.name, encoding=known.encoding, data=known.data)
        self._channels[topic] = self._channel(topic, encoding, schema), known.encode

    def offer_raw(self, topic: str, type: str, encoding: str, schema_encoding: str, schema: bytes) -> None:
        """A channel whose messages are given as bytes."""
        made = foxglove.Schema(name=type, encoding=schema_encoding, data=schema)
        self._channels[topic] = self._channel(topic, encoding, made), bytes

    def _channel(self, topic: str, encoding: str, schema: foxglove.Schema) -> foxglove.Channel:
        return foxglove.Channel(topic, message_encoding=encoding, schema=schema, context=self.context)

    def end(self, topic: str) -> None:
        """It is not offered any more."""
        if topic in self._channels:
            self._channels.pop(topic)[0].close()

    def publish(self, topic: str, message: Any, log_time: int | None = None) -> bytes:
        """The bytes of it, as they were sent."""
        channel, encode = self._channels[topic]
        raw: bytes = encode(message)
        channel.log(raw, log_time=log_time)
        return raw


@contextmanager
def peer(
    capabilities: Sequence[Capability] = (), encodings: Sequence[str] | None = None, most_queued: int | None = None
) -> Iterator[Peer]:
    one = Peer(capabilities, encodings, most_queued)
    try:
        yield one
    finally:
        one.stop()
