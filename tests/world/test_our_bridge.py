"""Our bridge answers as the real ones did, transcript by transcript."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np
import pytest

from server.rosbridge_server.server import RosBridge
from tests.world.compared import streams
from tests.world.played import BEGAN_S, LATE, Played, run
from tests.world.transcripts import names, needs_transcripts, read

pytestmark = [pytest.mark.world(n=1), needs_transcripts]

FRAGMENT_SIZE = {"ros1/ops_max_message_size": 4_000, "ros2/ops_max_message_size": 4_000}


def advertise_conflict(bridge: RosBridge) -> None:
    bridge.advertise("/conflict", LATE["/conflict"])


def find_nothing(bridge: RosBridge) -> None:
    """A bridge that has only just started, and has not found the other nodes yet."""
    for node in ("/rosapi", "/car"):
        bridge.end_node(node)
    for topic in bridge.graph.topics():
        bridge.unadvertise(topic.name)


def leave_topics(bridge: RosBridge) -> None:
    """What the recording before had left at the master."""
    for topic in ("/late", "/ours"):
        bridge.advertise(topic, "std_msgs/String")


def start_rosapi(bridge: RosBridge) -> None:
    bridge.add_rosapi()


ACTS: dict[str, dict[int, Callable[[RosBridge], None]]] = {  # what happened to ROS without a note, by line
    "ros1/subscribe_errors": {57: advertise_conflict},
    "ros2/subscribe_errors": {51: advertise_conflict},
    "ros1/lifecycle_rosapi_sigterm": {13: start_rosapi},
    "ros2/lifecycle_rosapi_sigterm": {13: start_rosapi},
    "ros1/ops_max_message_size": {2: leave_topics},
    "ros2/ops_max_message_size": {2: find_nothing},
    "ros2/lifecycle_sigint": {2: find_nothing},
}

NOT_PLAYED = {
    "ros1/auth": "started with a demand for a login, which ends the connection",
    **{f"ros{ros}/globs_rosapi": "started with names that rosapi hides" for ros in (1, 2)},
    **{f"ros{ros}/globs_topics": "started with topics that it refuses in silence" for ros in (1, 2)},
    "ros1/lifecycle_roscore": "the master of ROS ends",
    "ros2/lifecycle_sigterm": "the bridge lives on without ROS",
}

LOG = "the log topic's publishers are nodes of ROS, which our bridge does not have"
PARAMETERS = "parameters of other nodes are not simulated"
KILLED = "a killed node of ROS leaves services behind that nobody answers"
KEPT = "the publisher of a client that has gone stays for 10 s there, and ends at once here"
LOST = "the real one cannot encode it and sends nothing"
GONE = "no answer where the client that offers the service has gone; ours reports it"
WAITED = "a topic without a type is refused there, and waited for here"
REFUSED = "a refused subscription stays there, and is none here"
OTHERWISE: dict[tuple[str, str], str] = {  # answers by id and topics by name that are not compared
    ("ros1/discover", "c40"): "rosapi was named /rosapi_node there, so /rosapi was nobody",
    ("ros1/discover", "c46"): LOG,
    ("ros1/discover", "c77"): PARAMETERS,
    ("ros2/discover", "c1"): "this rosapi had just started and had not found the car yet",
    ("ros2/discover", "c2"): "this rosapi had just started and had not found the car yet",
    ("ros2/discover", "c21"): "NavSatStatus has a default value in newer ROS 2, and rosbags does not keep defaults",
    ("ros2/discover", "c44"): LOG,
    ("ros2/subscribe_cbor_raw", "cbor-raw /everything"): "recorded with another definition than discover has",
    **{(f"ros{ros}/discover_no_rosapi", f"c{number}"): KILLED for ros in (1, 2) for number in (8, 9, 10)},
    **{("ros2/lifecycle_car_death", f"c{number}"): KILLED for number in range(3, 8)},
    **{(f"ros{ros}/lifecycle_clean", f"c{number}"): KEPT for ros in (1, 2) for number in range(1, 6)},
    ("ros1/publishers_ended", "c43"): KEPT,
    ("ros2/publishers_ended", "c49"): KEPT,
    **{(f"ros{ros}/services", id): GONE for ros in (1, 2) for id in ("fc2", "c18")},
    **{(f"ros{ros}/ops_fragments_size", "fr"): "fragments in the wrong order, which ours puts right" for ros in (1, 2)},
    **{(f"ros{ros}/subscribe_errors", "json /catvehicle/vel"): REFUSED for ros in (1, 2)},
    **{(f"ros{ros}/subscribe_errors", "c1"): WAITED for ros in (1, 2)},
    **{
        ("ros1/subscribe_cbor", f"cbor {topic}"): LOST
        for topic in (
            "/catvehicle/odom", "/everything", "/fixed", "/flags", "/gps_fix", "/imu", "/joint_states", "/names",
            "/rosout",
        )
    },
    **{
        ("ros2/subscribe_cbor", f"cbor {topic}"): LOST
        for topic in (
            "/bounded", "/catvehicle/odom", "/everything", "/fixed", "/flags", "/gps_fix", "/imu", "/names", "/octets",
            "/short_text",
        )
    },
    **{("ros2/subscribe_json", f"json {topic}"): LOST for topic in ("/octets", "/short_text")},
    **{("ros2/neighbour_png", f"png {topic}"): LOST for topic in ("/catvehicle/vel", "/note")},
    **{("ros2/subscribe_options", f"png /catvehicle/vel{how}"): LOST for how in ("", " in fragments")},
    **{(f"ros{ros}/subscribe_options", "cbor /catvehicle/vel"): "longer than its fragments" for ros in (1, 2)},
}  # fmt: skip
ENDED = {"ros1/publish": 319, "ros2/publish": 340}  # lines: received of a publisher that ours ended at once
ORDER = {"ros2/services": "the calls of a connection wait for its slow one there, and not here"}


@cache
def play(name: str) -> Played:
    async def played() -> Played:
        found = Played(read(name), FRAGMENT_SIZE.get(name))
        await found.run(ACTS.get(name))
        return found

    return run(played())


def conns(name: str) -> list[str]:
    return sorted({line.conn for line in read(name).lines if line.kind in ("in", "out")})


def theirs(name: str, conn: str) -> list[str | bytes]:
    return [line.frame for line in read(name).lines if line.kind == "in" and line.conn == conn]


def shown(name: str, frames: Iterable[str | bytes]) -> dict[str, list[Any]]:
    """Frames by topic or by the id of their answer."""
    found = streams(frames, read(name))
    answers = found.pop("answers", [])
    if name not in ORDER:
        found["order of answers"] = [
            id for id in (str(one.get("id")) for one in answers) if (name, id) not in OTHERWISE
        ]
    for answer in answers:
        found.setdefault(str(answer.get("id")), []).append(answer)
    return found


@pytest.mark.parametrize("name", [name for name in names() if name not in NOT_PLAYED])
def test_the_same_frames_and_silences(name: str) -> None:
    differing = set()
    for conn in conns(name):
        ours, real = shown(name, play(name).frames(conn)), shown(name, theirs(name, conn))
        for what in ours.keys() | real.keys():
            if (name, what) in OTHERWISE:
                differing |= {what} if ours.get(what) != real.get(what) else set()
            else:
                assert ours.get(what) == real.get(what), (conn, what)
    assert differing == {what for other, what in OTHERWISE if other == name}, "what the table names does differ"


@pytest.mark.parametrize("name", ENDED)
def test_the_same_messages_reach_ros(name: str) -> None:
    played = play(name)
    lines = [line.of["received"] for line in read(name).lines if line.kind == "received" and line.number != ENDED[name]]
    listened = {line["topic"] for line in lines}
    ours = [[topic, comparable(message)] for topic, message in played.received if topic in listened]
    theirs = [[line["topic"], comparable(from_text(line["text"]))] for line in lines]
    assert ours == theirs


def test_the_tables_name_what_there_is() -> None:
    for name in (*FRAGMENT_SIZE, *ACTS, *NOT_PLAYED, *ORDER, *(name for name, _ in OTHERWISE)):
        assert name in names()
    assert len(names()) == 50


def comparable(message: Any) -> Any:
    """NaN is itself; a time is now, or what was given of it."""
    if isinstance(message, dict):
        if set(message) in ({"secs", "nsecs"}, {"sec", "nanosec"}):
            seconds, rest = message.values()
            if abs(seconds - BEGAN_S) < 3_000:
                return "now"
            return (seconds, "the nanoseconds of now" if rest > 1_000_000 else rest)
        return {name: comparable(value) for name, value in message.items()}
    if isinstance(message, bytes | np.ndarray):
        return comparable(list(message) if isinstance(message, bytes) else message.tolist())
    if isinstance(message, list | tuple):
        return [comparable(value) for value in message]
    return "nan" if isinstance(message, float) and math.isnan(message) else message


def from_text(text: str) -> Any:
    """A message from what Python shows of it: YAML in ROS 1, an expression in ROS 2."""
    if "(" in text.partition(":")[0]:
        return _of_call(ast.parse(text, mode="eval").body)
    return _of_yaml(text)


def _of_call(node: ast.expr) -> Any:
    match node:
        case ast.Call(func=ast.Name(id="array"), args=[values, *_]):
            return _of_call(values)
        case ast.Call(keywords=keywords):
            return {keyword.arg: _of_call(keyword.value) for keyword in keywords}
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_of_call(item) for item in items]
        case ast.Name(id=name):
            return float(name)
        case ast.UnaryOp(operand=ast.Name(id=name)):
            return -float(name)
        case _:
            return ast.literal_eval(node)


def _of_yaml(text: str) -> Any:
    rows = [(len(row) - len(row.lstrip()), row.strip()) for row in text.splitlines() if row.strip()]
    return _block(rows, 0)


def _block(rows: list[tuple[int, str]], depth: int) -> Any:
    """Remove the first rows of this depth and return their value."""
    if rows[0][1][0] == "-":
        items = []
        while rows and rows[0][0] == depth and rows[0][1][0] == "-":
            text = rows.pop(0)[1][1:].strip()
            items.append(_scalar(text) if text else _block(rows, rows[0][0]))
        return items
    found: dict[str, Any] = {}
    while rows and rows[0][0] == depth and rows[0][1][0] != "-":
        name, _, value = rows.pop(0)[1].partition(":")
        found[name] = _scalar(value.strip()) if value.strip() else _block(rows, rows[0][0])
    return found


def _scalar(text: str) -> Any:
    if re.fullmatch(r"-?(nan|inf)", text):
        return float(text)
    return ast.literal_eval(text)
