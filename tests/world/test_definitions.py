"""Definitions of types as real bridges give them: learnt, and written as ROS writes its messages."""

from __future__ import annotations

import json
from typing import Any

import pytest

from server.judge.message import RosVersion
from server.recording.read.schemas import TypeBook
from server.rosbridge.live_source import CallFailed
from server.vehicle import discovery
from tests.world.test_encoding_choice import VERSIONS, definitions, transcript

pytestmark = pytest.mark.world(n=5)


class Link:
    """Answers service calls; everything else fails."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self.answers = answers
        self.called: list[str] = []

    async def call(self, service: str, arguments: Any = None, *, timeout_s: float = 2.0) -> Any:
        self.called.append(service)
        if service not in self.answers:
            raise CallFailed("no such service")
        return self.answers[service]


def answer(version: RosVersion) -> Any:
    """What the real rosapi answered to topics_and_raw_types."""
    for line in transcript(version, "discover"):
        if line.get("dir") == "in" and "typedefs_full_text" in line["text"]:
            return json.loads(line["text"])["values"]
    raise AssertionError("no definitions")


# The real ROS 2 rosapi had no files of this package, and wstring is no primitive that is written.
UNKNOWN: dict[RosVersion, set[str]] = {
    1: set(),
    2: {"rosbridge_msgs/msg/ConnectedClients", "car_msgs/msg/Octets"},
}


@pytest.mark.parametrize("version", VERSIONS)
async def test_the_definitions_of_a_real_rosapi_are_learnt(version: RosVersion) -> None:
    types = set(definitions(version))
    link: Any = Link({"/rosapi/topics_and_raw_types": answer(version)})
    found = await discovery.fetch_definitions(link, types, version)
    assert types - set(found) <= {"std_msgs/Empty", "rosbridge_msgs/msg/ConnectedClients"}
    assert "message_details" not in " ".join(link.called) or version == 1
    assert not any("failed to get" in text for text in found.values()), "a message about a failure is no definition"
    book = TypeBook(version)
    book.learn(found)
    schemas = {type: book.schema(type) for type in types}
    assert {type for type, schema in schemas.items() if schema is None} == UNKNOWN[version]
    for type, schema in schemas.items():
        if schema is not None:
            assert (schema.encoding, schema.message_encoding) == (
                (f"ros{version}msg", "ros1" if version == 1 else "cdr")
            )
            assert schema.encode is not None
            if type in found:
                assert schema.data.decode().startswith(found[type].rstrip()), "the bridge's own text"


@pytest.mark.parametrize("version", VERSIONS)
async def test_the_misspelled_field_is_not_accepted(version: RosVersion) -> None:
    values = answer(version)
    values["typedefs_full_texts"] = values.pop("typedefs_full_text")
    link: Any = Link({"/rosapi/topics_and_raw_types": values})
    assert await discovery.fetch_definitions(link, set(values["types"]), version) == {}


async def test_nothing_is_requested_of_ros_2_that_can_end_rosapi() -> None:
    """On ROS 2 message_details of a type with a bounded array, bounded string or wstring ends rosapi."""
    empty = {"topics": [], "types": [], "typedefs_full_text": []}
    for version, calls in ((1, 2), (2, 1), (None, 1)):
        link: Any = Link({"/rosapi/topics_and_raw_types": empty})
        assert await discovery.fetch_definitions(link, {"car_msgs/Mixed"}, version) == {}  # type: ignore[arg-type]
        assert len(link.called) == calls


@pytest.mark.parametrize("version", VERSIONS)
def test_every_message_of_a_real_bridge_is_written_as_its_type(version: RosVersion) -> None:
    """What came in the transcripts as JSON, and that of `/tf` among it."""
    book = TypeBook(version)
    texts = definitions(version)
    book.learn({type: text for type, text in texts.items() if text and not text.startswith("# failed")})
    type, written = "", dict.fromkeys(texts, 0)
    for line in transcript(version, "subscribe_json"):
        if line.get("dir") == "out":
            operation = json.loads(line["text"])
            if operation["op"] == "subscribe":
                type = operation["type"]
        elif line.get("dir") == "in" and (schema := book.schema(type)) is not None:
            assert schema.encode is not None
            schema.encode(json.loads(line["text"])["msg"])
            written[type] += 1
    tf = "tf2_msgs/TFMessage" if version == 1 else "tf2_msgs/msg/TFMessage"
    assert written[tf] >= 4
    assert sum(1 for count in written.values() if count) >= 25
