"""Our bridge answers as the real ones did, transcript by transcript."""

from __future__ import annotations

import ast
import json
import math
import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import pytest

from server.rosbridge_server.server import Like, RealOptions, RosBridge
from tests.world.compared import streams
from tests.world.played import BEGAN_S, LATE, Played, run
from tests.world.transcripts import names, needs_transcripts, read

pytestmark = [pytest.mark.world(n=1), needs_transcripts]

STARTED = {  # how the recorded bridges were started, where not plainly
    f"ros{ros}/{name}": options
    for ros in (1, 2)
    for name, options in {
        "auth": RealOptions(authenticate=True),
        "globs_topics": RealOptions(topics_glob=("/catvehicle/*",)),
        "globs_services": RealOptions(services_glob=("/car/*",)),
        "globs_rosapi": RealOptions(
            rosapi_topics_glob=("/catvehicle/*",),
            rosapi_services_glob=("/rosapi/*",),
            rosapi_params_glob=("/car_name",),
        ),
        "ops_max_message_size": RealOptions(max_message_bytes=4000),
    }.items()
}


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

LOG = "the log topic's publishers are nodes of ROS, which our bridge does not have"
PARAMETERS = "parameters of other nodes are not simulated"
OTHERWISE: dict[tuple[str, str], str] = {  # answers by id and topics by name that are not compared
    ("ros1/discover", "c40"): "rosapi was named /rosapi_node there, so /rosapi was nobody",
    ("ros1/discover", "c46"): LOG,
    ("ros1/discover", "c77"): PARAMETERS,
    ("ros2/discover", "c1"): "this rosapi had just started and had not found the car yet",
    ("ros2/discover", "c2"): "this rosapi had just started and had not found the car yet",
    ("ros2/discover", "c21"): "NavSatStatus has a default value in newer ROS 2, and rosbags does not keep defaults",
    ("ros2/discover", "c44"): LOG,
    ("ros2/lifecycle_sigterm", "slow"): "a call that waits while its bridge is ended: ours ends at once",
    ("ros2/subscribe_cbor_raw", "cbor-raw /everything"): "recorded with another definition than discover has",
}


@cache
def play(name: str, like: Like = "real") -> Played:
    transcript = read(name)

    async def played() -> Played:
        found = Played(transcript, like, STARTED.get(name))
        await found.run(ACTS.get(name))
        return found

    return run(played())


def conns(name: str) -> list[str]:
    return sorted({line.conn for line in read(name).lines if line.kind in ("in", "out")})


def shown(name: str, frames: Iterable[str | bytes]) -> dict[str, list[Any]]:
    """Frames in streams, without what is not compared."""
    found = streams(frames, read(name))
    for key in list(found):
        if (name, key) in OTHERWISE:
            del found[key]
    found["answers"] = [answer for answer in found.get("answers", []) if (name, str(answer.get("id"))) not in OTHERWISE]
    return found


@pytest.mark.parametrize("name", names())
def test_the_same_frames_and_silences(name: str) -> None:
    played = play(name)
    for conn in conns(name):
        theirs = [line.frame for line in read(name).lines if line.kind == "in" and line.conn == conn]
        assert shown(name, played.frames(conn)) == shown(name, theirs), conn


@pytest.mark.parametrize("name", names())
def test_the_same_ends_of_connections(name: str) -> None:
    played = play(name)
    for conn in conns(name):
        ends = [line.of["code"] for line in read(name).lines if line.text == "close" and line.conn == conn]
        by_bridge = [code for code in ends if code in (1005, 1009)]
        assert [code for code in played.codes(conn) if code is not None] == by_bridge, conn


@pytest.mark.parametrize("name", ["ros1/publish", "ros2/publish"])
def test_the_same_messages_reach_ros(name: str) -> None:
    played = play(name)
    lines = [line.of["received"] for line in read(name).lines if line.kind == "received"]
    listened = {line["topic"] for line in lines}
    ours = [[topic, comparable(message)] for topic, message in played.received if topic in listened]
    theirs = [[line["topic"], comparable(from_text(line["text"]))] for line in lines]
    assert ours == theirs


def test_the_tables_name_what_there_is() -> None:
    for name in (*STARTED, *ACTS, *(name for name, _ in OTHERWISE)):
        assert name in names()
    for name, what in OTHERWISE:
        text = "".join(str(line.frame) for line in read(name).lines)
        assert what in text or what.startswith("cbor-raw ")
    assert len(names()) == 50


@pytest.mark.parametrize("ros", [1, 2])
def test_the_helpful_bridge_sends_the_same_data(ros: int) -> None:
    name = f"ros{ros}/subscribe_json"
    ours = play(name, "helpful").frames("")
    theirs = [line.frame for line in read(name).lines if line.kind == "in"]
    assert messages(ours) == messages(theirs)


@pytest.mark.parametrize("ros", [1, 2])
def test_the_helpful_bridge_tells_the_same_of_the_graph(ros: int) -> None:
    name = f"ros{ros}/discover"
    ours, theirs = (
        {answer["id"]: answer["values"] for answer in shown(name, frames).get("answers", []) if answer["result"]}
        for frames in (play(name, "helpful").frames(""), [line.frame for line in read(name).lines if line.kind == "in"])
    )
    assert len(theirs) > 60
    assert {id: ours.get(id) for id in theirs} == theirs


def messages(frames: Iterable[str | bytes]) -> dict[str, list[Any]]:
    """The messages of each topic, with null for what is not JSON."""
    found: dict[str, list[Any]] = {}
    for frame in frames:
        body = json.loads(frame, parse_constant=lambda word: None)
        if body["op"] == "publish" and body["topic"] not in NOT_SENT:
            found.setdefault(body["topic"], []).append(body["msg"])
    return found


NOT_SENT = {"/octets", "/short_text"}  # the real ROS 2 bridge cannot write them, ours can


def comparable(message: Any) -> Any:
    """NaN is itself; a time is now, or what was given of it."""
    if isinstance(message, dict):
        if set(message) in ({"secs", "nsecs"}, {"sec", "nanosec"}):
            seconds, rest = message.values()
            if abs(seconds - BEGAN_S) < 3_000:
                return "now"
            return (seconds, "the nanoseconds of now" if rest > 1_000_000 else rest)
        return {name: comparable(value) for name, value in message.items()}
    if isinstance(message, bytes):
        return list(message)
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
            return {word.arg: _of_call(word.value) for word in keywords}
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
    """What the first rows say that are as deep as this; they are taken away."""
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
