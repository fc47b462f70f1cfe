"""The gate before the socket: every operation that is sent to a bridge is checked against the tables below.

A real bridge reports almost nothing to its client, and some of what it can be sent harms others: it can end a topic
for every client, publish zeros, leave the connection without answers, or end rosapi. What is not in the tables is
refused before it is sent.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from server.rosbridge import codec

MAX_NAME = 255
MAX_ID = 600  # an id names an operation and its topic
MAX_TEXT = 255
MAX_THROTTLE_MS = 60_000
MAX_QUEUE = 1000
MAX_FRAME_BYTES = 8192
MAX_ADVERTISED = 100
EXACT = 2**53  # up to here a whole number is the same as a float

_TOPIC = re.compile(r"(/[A-Za-z0-9_]+)+", re.ASCII)
_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/msg)?/[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_TYPE_OF_ROS_1 = re.compile(r"[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*", re.ASCII)

Check = Callable[[Any], bool]
Fields = Mapping[str, "Check | Fields | Stamp"]


class NotAllowed(ValueError):
    """An operation that is not sent, because it could harm the bridge, car or other clients; `str()` has the reason."""


class Stamp:
    """A time of a message: ROS 1 calls its fields secs and nsecs, ROS 2 sec and nanosec."""


def is_topic(value: Any) -> bool:
    """Whether this is a global topic name that both ROS versions can register."""
    return isinstance(value, str) and len(value) <= MAX_NAME and _TOPIC.fullmatch(value) is not None


def is_type(value: Any) -> bool:
    """Whether this is a message type as either ROS version spells it."""
    return isinstance(value, str) and len(value) <= MAX_NAME and _TYPE.fullmatch(value) is not None


def _is_type_of_ros_1(value: Any) -> bool:
    # On ROS 2 this question can end rosapi.
    return isinstance(value, str) and len(value) <= MAX_NAME and _TYPE_OF_ROS_1.fullmatch(value) is not None


def _is_id(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= MAX_ID and value.isprintable()


def _is_compression(value: Any) -> bool:
    # The others can cost another client its messages, or never arrive.
    return value in ("none", "cbor") and isinstance(value, str)


def _whole(minimum: int, maximum: int) -> Check:
    return lambda value: type(value) is int and minimum <= value <= maximum


def _is_float64(value: Any) -> bool:
    if type(value) is int:
        return abs(value) <= EXACT
    return isinstance(value, float) and math.isfinite(value)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MAX_TEXT and value.isprintable()


_UINT32 = _whole(0, 2**32 - 1)
_NANOSECONDS = _whole(0, 999_999_999)
STAMPS: tuple[Fields, ...] = (
    {"secs": _UINT32, "nsecs": _NANOSECONDS},
    {"sec": _whole(0, 2**31 - 1), "nanosec": _NANOSECONDS},  # an int32 in ROS 2
)
_VECTOR: Fields = {"x": _is_float64, "y": _is_float64, "z": _is_float64}
_TWIST: Fields = {"linear": _VECTOR, "angular": _VECTOR}

# All that is ever published to a car, by type in the spelling of ROS 1. `seq` of a header is the bridge's own.
PUBLISHED: Mapping[str, Fields] = {
    "geometry_msgs/Twist": _TWIST,
    "geometry_msgs/TwistStamped": {"header": {"stamp": Stamp(), "frame_id": _is_text}, "twist": _TWIST},
    "std_msgs/UInt32": {"data": _UINT32},
}

# All services that are ever called, with their arguments: each is there on every rosapi and changes nothing.
SERVICES: Mapping[str, Mapping[str, Check]] = {
    "/rosapi/topics": {},
    "/rosapi/topics_and_raw_types": {},
    "/rosapi/get_time": {},
    "/rosapi/topic_type": {"topic": is_topic},
    "/rosapi/publishers": {"topic": is_topic},
    "/rosapi/subscribers": {"topic": is_topic},
    "/rosapi/message_details": {"type": _is_type_of_ros_1},
}

# Required fields, then optional ones.
OPERATIONS: Mapping[str, tuple[Mapping[str, Check], Mapping[str, Check]]] = {
    "subscribe": (
        {
            "id": _is_id,
            "topic": is_topic,
            "compression": _is_compression,
            "throttle_rate": _whole(0, MAX_THROTTLE_MS),
            "queue_length": _whole(0, MAX_QUEUE),
        },
        {"type": is_type},
    ),
    "unsubscribe": ({"id": _is_id, "topic": is_topic}, {}),
    "advertise": ({"id": _is_id, "topic": is_topic, "type": is_type}, {}),
    "unadvertise": ({"id": _is_id, "topic": is_topic}, {}),
    "publish": ({"topic": is_topic, "msg": lambda value: type(value) is dict}, {}),
    "call_service": (
        {
            "id": _is_id,
            "service": lambda value: isinstance(value, str) and value in SERVICES,
            "args": lambda value: type(value) is dict,
        },
        {},
    ),
}


class Outgoing:
    """The gate of one connection: it keeps what was advertised on it, and publishes nothing else."""

    def __init__(self) -> None:
        self._advertised: dict[str, str] = {}  # topic → type in the spelling of ROS 1

    def reset(self) -> None:
        """Another connection begins: nothing is advertised on it."""
        self._advertised.clear()

    def frame(self, operation: Any) -> bytes:
        """The text frame of an operation that does no harm. Raises NotAllowed."""
        op = self._check(operation)
        try:
            frame = codec.encode(operation)
        except (TypeError, ValueError) as error:  # half a character, for example
            raise NotAllowed(f"{op} cannot be written as JSON") from error
        if len(frame) > MAX_FRAME_BYTES:
            raise NotAllowed(f"{op} is longer than {MAX_FRAME_BYTES} bytes")
        self._remember(op, operation)
        return frame

    def _check(self, operation: Any) -> str:
        if type(operation) is not dict:
            raise NotAllowed("a frame is a JSON object")
        op = operation.get("op")
        if not isinstance(op, str) or op not in OPERATIONS:
            raise NotAllowed(f"there is no operation {_short(op)}")
        required, optional = OPERATIONS[op]
        if missing := required.keys() - operation.keys():
            raise NotAllowed(f"{op} without {', '.join(sorted(missing))}")
        for name, value in operation.items():
            if name == "op":
                continue
            check = required.get(name) or optional.get(name)
            if check is None:
                raise NotAllowed(f"{op} has no field {_short(name)}")
            if not check(value):
                raise NotAllowed(f"{op} with {name} {_short(value)}")
        match op:
            case "call_service":
                _check_arguments(operation["service"], operation["args"])
            case "advertise":
                self._check_advertise(operation["topic"], _plain(operation["type"]))
            case "publish":
                self._check_publish(operation["topic"], operation["msg"])
        return op

    def _check_advertise(self, topic: str, type: str) -> None:
        if type not in PUBLISHED:
            raise NotAllowed(f"{_short(type)} is never published")
        if self._advertised.get(topic, type) != type:
            raise NotAllowed(f"{_short(topic)} is advertised as {self._advertised[topic]} already")
        if topic not in self._advertised and len(self._advertised) >= MAX_ADVERTISED:
            raise NotAllowed("too many topics are advertised")

    def _check_publish(self, topic: str, message: dict[str, Any]) -> None:
        type = self._advertised.get(topic)
        if type is None:
            raise NotAllowed(f"{_short(topic)} is not advertised on this connection")
        _check_fields(message, PUBLISHED[type], type)

    def _remember(self, op: str, operation: dict[str, Any]) -> None:
        if op == "advertise":
            self._advertised[operation["topic"]] = _plain(operation["type"])
        elif op == "unadvertise":
            self._advertised.pop(operation["topic"], None)


def _check_arguments(service: str, arguments: dict[str, Any]) -> None:
    table = SERVICES[service]
    if arguments.keys() != table.keys():
        raise NotAllowed(f"{service} takes {', '.join(table) or 'no argument'}")
    for name, value in arguments.items():
        if not table[name](value):
            raise NotAllowed(f"{service} with {name} {_short(value)}")


def _check_fields(message: Any, fields: Fields, where: str) -> None:
    """Every field is there, none besides, and each fits. Raises NotAllowed."""
    if type(message) is not dict or message.keys() != fields.keys():
        raise NotAllowed(f"{where} has the fields {', '.join(fields)}")
    for name, check in fields.items():
        value, inner = message[name], f"{where}.{name}"
        if isinstance(check, Stamp):
            _check_stamp(value, inner)
        elif isinstance(check, Mapping):
            _check_fields(value, check, inner)
        elif not check(value):
            raise NotAllowed(f"{inner} cannot be {_short(value)}")


def _check_stamp(value: Any, where: str) -> None:
    fields = next((one for one in STAMPS if type(value) is dict and one.keys() == value.keys()), STAMPS[0])
    _check_fields(value, fields, where)


def _plain(type: str) -> str:
    return type.replace("/msg/", "/")


def _short(value: Any) -> str:
    try:
        return ascii(value)[:80]
    except Exception:  # a value whose own code fails
        return f"({value.__class__.__name__})"
