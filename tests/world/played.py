"""Plays the client's side of a transcript at our bridge, in a time of its own, and notes what comes back."""

from __future__ import annotations

import asyncio
import base64
import dataclasses
import json
import math
import selectors
import struct
import zlib
from collections.abc import Callable, Coroutine
from functools import cache
from typing import Any, TypeVar

import cbor2
import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from server.judge.message import RosVersion
from server.rosbridge_server.client import Client
from server.rosbridge_server.server import RosBridge, ServiceFailed
from server.rosbridge_server.shape import Field, fields
from tests.world.transcripts import Line, Transcript, read

BEGAN_S = 1_795_403_000.0  # about when the transcripts were made
SILENT = {  # what the car sends on topics whose messages no transcript shows as JSON
    "/short_text": [{"short_text": "abc"}],
    "/octets": [{"one_byte": 7, "byte_list": [1, 2], "one_char": 3, "chars": [4], "wide": "w"}],
}
LATE = {"/late": "std_msgs/String", "/conflict": "std_msgs/Float32"}  # published by a node that comes later
T = TypeVar("T")


def end_rosapi(bridge: RosBridge) -> None:
    bridge.end_node("/rosapi")


def start_late(bridge: RosBridge) -> None:
    bridge.advertise("/late", LATE["/late"])


def end_late(bridge: RosBridge) -> None:
    bridge.unadvertise("/late")


NOTES: dict[str, Callable[[RosBridge], None]] = {  # what the recorder did to ROS
    "rosapi ended with SIGINT": end_rosapi,
    "rosapi SIGTERM": end_rosapi,
    "rosapi started again": RosBridge.add_rosapi,
    "rosapi started again, new connection": RosBridge.add_rosapi,
    "publisher up, nobody subscribes": start_late,
    "publisher ended by SIGINT, we still subscribe": end_late,
    "SIGKILL, 20 s after": end_late,
}


class _Selector(selectors.DefaultSelector):
    """Where nothing happens, time jumps to the next timer."""

    now = 0.0

    def select(self, timeout: float | None = None) -> Any:
        if timeout is not None and timeout > 0:
            self.now += timeout
        return super().select(0)


class _Loop(asyncio.SelectorEventLoop):
    def __init__(self) -> None:
        self._own = _Selector()
        super().__init__(self._own)

    def time(self) -> float:
        return self._own.now


def run(main: Coroutine[Any, Any, T]) -> T:
    """Runs without waiting: sleeping moves the clock."""
    with asyncio.Runner(loop_factory=_Loop) as runner:
        return runner.run(main)


class Wire:
    """A socket without a network: keeps what is written."""

    def __init__(self) -> None:
        self.frames: list[str | bytes] = []
        self.on_ready: Callable[[], None] | None = None
        self.on_lost: Callable[[], None] | None = None
        self.is_ready = True
        self.is_drained = True

    def write(self, frames: bytes) -> None:
        """Of one or more whole text or binary frames."""
        while frames:
            assert frames[0] in (0x81, 0x82)
            head = {126: 4, 127: 10}.get(frames[1], 2)
            end = head + (frames[1] if head == 2 else int.from_bytes(frames[2:head], "big"))
            payload = frames[head:end]
            self.frames.append(payload.decode() if frames[0] == 0x81 else payload)
            frames = frames[end:]


class Played:
    """`frames`: what came back on each connection; `received`: what a ROS node got."""

    def __init__(self, transcript: Transcript, fragment_size: int | None = None) -> None:
        self.transcript = transcript
        self.bridge = RosBridge(
            ros_version=transcript.ros,
            fragment_size=fragment_size,
            node="/car",
            now=lambda: BEGAN_S + asyncio.get_running_loop().time(),
        )
        self.wires: dict[str, list[Wire]] = {}
        self.clients: dict[str, Client] = {}
        self.received: list[tuple[str, Any]] = []
        self.bridge.on_publish.append(lambda topic, type, message: self.received.append((topic, message)))
        set_up_car(self.bridge, transcript)

    def frames(self, conn: str) -> list[str | bytes]:
        return [frame for wire in self.wires.get(conn, []) for frame in wire.frames]

    async def run(self, acts: dict[int, Callable[[RosBridge], None]] | None = None) -> None:
        """Does every line at its time. `acts`: what happens to ROS before a line, by the line's number."""
        acts = acts or {}
        loop = asyncio.get_running_loop()
        steps: list[tuple[float, int, Any]] = [(line.at_s, 1, line) for line in self.transcript.lines]
        for at_s, topic, message in publications(self.transcript, self.bridge):
            steps.append((at_s, 2, (topic, message)))
        for at_s, _, step in sorted(steps, key=lambda step: (step[0], step[1])):
            await asyncio.sleep(max(0.0, at_s - loop.time()))
            if isinstance(step, tuple):
                self._publish(*step)
            else:
                act = acts.get(step.number) or (NOTES.get(step.text) if step.kind == "note" else None)
                if act is not None:
                    act(self.bridge)
                self._do(step)
            for _ in range(4):
                await asyncio.sleep(0)
        await asyncio.sleep(0.5)
        for client in self.clients.values():
            client.leave()

    def _publish(self, topic: str, message: Any) -> None:
        found = self.bridge.graph.find(topic)
        if topic in LATE and (found is None or "source" not in found.publishers):
            self.bridge.advertise(topic, LATE[topic])
            found = self.bridge.graph.find(topic)
        if found is not None and "source" in found.publishers:
            self.bridge.publish(topic, message)

    def _do(self, line: Line) -> None:
        if line.kind == "event" and line.text == "open":
            self._open(line.conn)
        elif line.kind == "event" and line.text == "close":
            self._close(line.conn)
        elif line.kind == "out" and line.conn in self.clients:
            frame = whole(line)
            self.clients[line.conn].handle(frame.encode() if isinstance(frame, str) else frame)

    def _open(self, conn: str) -> None:
        self._close(conn)
        wire = Wire()
        self.wires.setdefault(conn, []).append(wire)
        self.clients[conn] = Client(self.bridge, wire)  # type: ignore[arg-type]

    def _close(self, conn: str) -> None:
        client = self.clients.pop(conn, None)
        if client is not None:
            client.leave()


def whole(line: Line) -> str | bytes:
    """The frame as it was sent, where the transcript cut it."""
    cut = line.of.get("cut_from_chars")
    if cut is None or not isinstance(line.frame, str):
        return line.frame
    end = '"}}'
    return line.frame + "x" * (cut - len(line.frame) - len(end)) + end


def set_up_car(bridge: RosBridge, transcript: Transcript) -> None:
    """The node of the transcripts: its topics with their definitions, its services, its parameters."""
    texts = definitions(bridge.ros_version)
    topics = transcript.head["topics"]
    if len(topics) < 25 or any(
        "(" in type for type in topics.values()
    ):  # these are what the transcript is about, not all there is
        topics = read(f"ros{bridge.ros_version}/discover").head["topics"]
    for topic, type in topics.items():
        bridge.advertise(topic, type, texts.get(type))
    log = "rosgraph_msgs/Log" if bridge.ros_version == 1 else "rcl_interfaces/msg/Log"
    bridge.advertise("/rosout", log, texts.get(log))
    add_car_services(bridge)
    if bridge.ros_version == 1:
        limits = {"speed": 2.5, "list": [1, 2.5, "x", True]}
        bridge.parameters |= {"/car_name": "cät", "/car_limits": limits, "/rosdistro": "Debian\n"}
    else:
        bridge.parameters |= {"/car:car_name": "cät", "/car:limits": [1.0]}


def add_car_services(bridge: RosBridge) -> None:
    async def slow(args: Any) -> Any:
        await asyncio.sleep(7.0)
        return {"success": True, "message": "after 7 s"}

    def bad(args: Any) -> Any:
        raise ServiceFailed("the car said no")

    answer = "bool success\nstring message\n"
    bridge.add_service(
        "/car/engage",
        "std_srvs/SetBool",
        lambda args: {"success": args["data"], "message": "engaged" if args["data"] else "off"},
        ("data",),
        request="bool data\n",
        response=answer,
    )
    bridge.add_service("/car/slow", "std_srvs/Trigger", slow, request="", response=answer)
    if bridge.ros_version == 1:
        bridge.add_service("/car/bad", "std_srvs/Trigger", bad, request="", response=answer)


@cache
def definitions(ros: RosVersion) -> dict[str, str]:
    """The definitions of the car's types, as rosapi gave them."""
    for line in read(f"ros{ros}/discover").lines:
        if line.kind == "in" and "typedefs_full_text" in str(line.frame):
            values = json.loads(line.frame)["values"]
            found = zip(values["types"], values["typedefs_full_text"], strict=True)
            return {type: text for type, text in found if text and text[0:8] != "# failed"}
    raise AssertionError("discover has no typedefs_full_text")


def publications(transcript: Transcript, bridge: RosBridge) -> list[tuple[float, str, Any]]:
    """When the car published what: as the frames show it, and all the time where a subscription stayed silent."""
    all_ = windows(transcript)
    shown: dict[str, list[tuple[float, Window, Any]]] = {}
    for window in all_:
        for at_s, message in window.shown[:1] if window.is_queued else window.shown:
            shown.setdefault(window.full, []).append((min(at_s, window.until_s - 0.002), window, message))
    found: list[tuple[float, str, Any]] = []
    for topic, rows in shown.items():
        rows.sort(key=lambda row: row[0])
        while rows:  # one publication is what different connections show of it
            group = [rows.pop(0)]
            for row in list(rows):
                if row[0] > group[0][0] + 0.12:
                    break
                if all(row[1].conn != other[1].conn for other in group):
                    group.append(row)
                    rows.remove(row)
            best = max((row[2] for row in group), key=_exactness)
            found.append((group[0][0], topic, _message(bridge, topic, best)))
    for window in all_:
        found += [
            (at_s, window.full, _message(bridge, window.full, message)) for at_s, message in _between(window, all_)
        ]
    return found


def _exactness(message: Any) -> int:
    """Raw bytes hold everything, CBOR keeps NaN and both infinities, JSON neither."""
    text = repr(message)
    return 2 if "'bytes': b" in text else 0 if "None" in text else 1


def _between(window: Window, all_: list[Window]) -> list[tuple[float, Any]]:
    """What the car published besides: in a silent subscription, and between the messages of a throttled one."""
    topic, ros = window.full, window.ros
    if window.is_queued and window.shown:  # whether a message comes before the timer that makes room is chance: as then
        first_s, message = window.shown[0]
        late_s = 0.004 if ros == 1 else -0.004
        order = _after(cycle(ros, topic), message)
        steps = int((window.until_s - first_s) / 0.25)
        return [(first_s + 0.25 * step + late_s, order[(step - 1) % len(order)]) for step in range(1, steps + 1)]
    if window.throttle_s:
        pairs = [(at_s, other) for at_s, other in window.shown]
        return [
            (at_s + 0.25 * step, other)
            for at_s, message in pairs
            for step, other in enumerate(_after(cycle(ros, topic), message), start=1)
            if at_s + 0.25 * step < min(window.until_s, at_s + 0.9)
        ]
    others = [other for other in all_ if other.full == topic and other is not window]
    if window.shown or any(window.from_s < at_s < window.until_s for other in others for at_s, _ in other.shown):
        return []
    messages = SILENT.get(topic) or cycle(ros, topic)
    times = np.arange(window.from_s + 0.05, window.until_s - 0.01, 0.25)
    return [(float(at_s), messages[number % len(messages)]) for number, at_s in enumerate(times) if messages]


class Window:
    """One subscription from its first subscribe operation to its end, and what was shown of it."""

    def __init__(self, ros: RosVersion, conn: str, topic: str, from_s: float) -> None:
        self.ros, self.conn, self.topic, self.from_s = ros, conn, topic, from_s
        self.full = "/" + topic.strip("/")
        self.until_s = math.inf
        self.throttle_s = 0.0
        self.is_queued = False
        self.changed_s = -1.0  # when another encoding was requested
        self.ids: set[object] = set()
        self.shown: list[tuple[float, Any]] = []


def windows(transcript: Transcript) -> list[Window]:
    """Every subscription to a topic of the car."""
    found: list[Window] = []
    open_: dict[tuple[str, str], Window] = {}
    topics = {*read(f"ros{transcript.ros}/discover").head["topics"], "/late", "/conflict", "/rosout"}
    parts: dict[str, str] = {}
    end_s = transcript.lines[-1].at_s
    for line in transcript.lines:
        if line.kind == "event" and line.text == "close":
            for key in [key for key in open_ if key[0] == line.conn]:
                open_.pop(key).until_s = line.at_s
        elif line.kind == "out" and isinstance(line.frame, str):
            operation = parsed(line.frame)
            if not isinstance(operation, dict) or not isinstance(operation.get("topic"), str):
                continue
            key = (line.conn, operation["topic"])
            if operation.get("op") == "subscribe" and "/" + key[1].strip("/") in topics:
                if key not in open_:
                    open_[key] = Window(transcript.ros, line.conn, key[1], line.at_s)
                    found.append(open_[key])
                elif operation.get("compression", "none") in ("cbor", "cbor-raw", "png"):
                    open_[key].changed_s = line.at_s
                window = open_[key]
                window.ids.add(operation.get("id"))
                throttle = operation.get("throttle_rate", 0)
                if isinstance(throttle, int) and throttle > 0 and len(window.ids) == 1:
                    window.throttle_s = throttle / 1000.0
                    window.is_queued = operation.get("queue_length", 0) > 0
            elif operation.get("op") == "unsubscribe" and key in open_:
                open_[key].ids.discard(operation.get("id"))
                if operation.get("id") is None or not open_[key].ids:
                    open_.pop(key).until_s = line.at_s
        elif line.kind == "in":
            body = unpacked(line.frame, parts)
            if body is None or body.get("op") != "publish":
                continue
            key = (line.conn, body["topic"])
            mine = [window for window in found if (window.conn, window.topic) == key]
            if mine:
                changed_s = mine[-1].changed_s
                is_old = isinstance(line.frame, str) and '"png"' not in line.frame and 0 < line.at_s - changed_s < 0.1
                at_s = changed_s - 0.002 if is_old else line.at_s  # it was on its way already
                mine[-1].shown.append((at_s, body["msg"]))
    for window in found:
        window.until_s = min(window.until_s, end_s)
    return found


def parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return None


def unpacked(frame: str | bytes, parts: dict[str, str]) -> dict[str, Any] | None:
    """The object in a frame: JSON, CBOR, png, or the last of its fragments, whose pieces are kept in `parts`."""
    if isinstance(frame, bytes):
        return dict(cbor2.loads(frame))
    body = parsed(frame)
    if isinstance(body, dict) and body.get("op") == "png":
        return unpacked(picture_text(body["data"]), parts)
    if isinstance(body, dict) and body.get("op") == "fragment":
        id = str(body["id"])
        parts[id] = body["data"] if body["num"] == 0 else parts.get(id, "") + body["data"]
        if body["num"] + 1 < math.floor(body["total"]):
            return None
        whole = parsed(parts[id])
        return unpacked(parts[id], {}) if isinstance(whole, dict) else None
    return body if isinstance(body, dict) else None


def picture_text(data: str) -> str:
    """The text that a png frame hides in its pixels."""
    raw = base64.b64decode(data)
    width = struct.unpack(">I", raw[16:20])[0] * 3
    at, packed = 8, b""
    while at < len(raw):
        size, name = struct.unpack(">I4s", raw[at : at + 8])
        packed += raw[at + 8 : at + 8 + size] if name == b"IDAT" else b""
        at += size + 12
    rows = zlib.decompress(packed)
    before, pixels = bytes(width), bytearray()
    for start in range(0, len(rows), width + 1):
        before = _unfiltered(rows[start], rows[start + 1 : start + 1 + width], before)
        pixels += before
    return pixels.decode().rstrip("\n")


def _unfiltered(kind: int, row: bytes, above: bytes) -> bytes:
    made = bytearray()
    for at, value in enumerate(row):
        left, up, corner = (made[at - 3] if at > 2 else 0), above[at], (above[at - 3] if at > 2 else 0)
        near = min((left, up, corner), key=lambda other: abs(left + up - corner - other))
        made.append((value + (0, left, up, (left + up) // 2, near)[kind]) & 255)
    return bytes(made)


@cache
def cycle(ros: RosVersion, topic: str) -> list[Any]:
    """The messages that the car sends on a topic in turn, as JSON shows them."""
    found: list[Any] = []
    for line in read(f"ros{ros}/subscribe_json").lines:
        if line.kind == "in" and isinstance(line.frame, str):
            body = json.loads(line.frame)
            if body.get("topic") == topic and len(found) < 4 and body["msg"] not in found:
                found.append(body["msg"])
    return found


def _after(messages: list[Any], message: Any) -> list[Any]:
    """The cycle from behind a message on."""
    at = messages.index(message) + 1 if message in messages else 0
    return messages[at:] + messages[:at]


def _message(bridge: RosBridge, topic: str, shown: Any) -> Any:
    found = bridge.graph.find(topic)
    type = found.type if found is not None and found.type else None
    definitions = bridge.types.definitions(type) if type else None
    if type is None or definitions is None:
        return shown
    if isinstance(shown, dict) and set(shown) == {"secs", "nsecs", "bytes"}:  # cbor-raw
        return _of_bytes(bridge, bridge.types.long_name(type), definitions, shown["bytes"])
    return _typed(bridge.types.long_name(type), definitions, shown)


def _of_bytes(bridge: RosBridge, type: str, definitions: dict[str, Any], data: bytes) -> Any:
    """The message with these bytes."""
    store = get_typestore(Stores.ROS1_NOETIC if bridge.ros_version == 1 else Stores.ROS2_HUMBLE)
    store.register({name: one for name, one in definitions.items() if name not in store.fielddefs})
    read_ = store.deserialize_ros1 if bridge.ros_version == 1 else store.deserialize_cdr
    try:
        return _plain(read_(data, type))
    except SerdeError:  # a part of it is padded in a way that this reader does not know
        return None


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray) and value.dtype == np.uint8:
        return value.tobytes()
    if not dataclasses.is_dataclass(value):
        return value
    return {one.name: _plain(getattr(value, one.name)) for one in dataclasses.fields(value) if one.name[0] != "_"}


def _typed(type: str, definitions: dict[str, Any], shown: Any) -> dict[str, Any]:
    return {
        field.name: _typed_field(field, definitions, shown[field.name])
        for field in fields(type, definitions)
        if field.name in shown
    }


def _typed_field(field: Field, definitions: dict[str, Any], value: Any) -> Any:
    if isinstance(value, cbor2.CBORTag):
        codes = {69: "<u2", 70: "<u4", 71: "<u8", 72: "i1", 77: "<i2", 78: "<i4", 79: "<i8", 85: "<f4", 86: "<f8"}
        return np.frombuffer(value.value, dtype=codes[value.tag])
    if field.is_bytes and isinstance(value, str):
        return base64.b64decode(value)
    if isinstance(value, list):
        return [_typed_field(field.item(), definitions, item) for item in value]
    if field.is_message and isinstance(value, dict) and field.type in definitions:
        return value if set(value) <= {"secs", "nsecs"} else _typed(field.type, definitions, value)
    return math.nan if value is None and field.is_float else value
