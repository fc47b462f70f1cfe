"""What goes out on the wire."""

from __future__ import annotations

import json
import math
from typing import Any

import cbor2
import numpy as np
import pytest
from websockets.frames import Frame, Opcode

from server.rosbridge.codec import Unencodable, cbor_bytes, json_bytes
from server.rosbridge_server.encoding import Encoding, Outgoing, frame
from server.rosbridge_server.server import RosBridge

NOT_NUMBERS = np.array([1.5, math.nan, math.inf, -math.inf], dtype=np.float32)


@pytest.mark.parametrize("size", [0, 1, 125, 126, 127, 65_535, 65_536, 100_000])
def test_a_frame_is_what_websockets_itself_would_write(size: int) -> None:
    payload = bytes(size)
    assert frame(0x1, payload) == Frame(Opcode.TEXT, payload).serialize(mask=False)


def test_json_has_null_for_what_is_no_number() -> None:
    text = json_bytes({"ranges": NOT_NUMBERS, "x": math.nan, "y": [-math.inf], "z": np.float32(math.inf), "n": 1.25})
    assert json.loads(text) == {"ranges": [1.5, None, None, None], "x": None, "y": [None], "z": None, "n": 1.25}


def test_json_has_base64_for_bytes_and_lists_for_arrays() -> None:
    message = {"data": b"\x00\xffabc", "small": np.arange(3, dtype=np.uint8), "flags": np.array([True, False])}
    assert json.loads(json_bytes(message)) == {"data": "AP9hYmM=", "small": [0, 1, 2], "flags": [True, False]}


@pytest.mark.parametrize(
    "array",
    [
        np.array([1.0, math.nan, 2.0], dtype=">f4"),
        np.array([1.0, math.nan, 2.0, math.inf])[::-1],
        np.array([[1.0, math.nan], [2.0, 3.0]], dtype=">f8"),
    ],
    ids=["foreign byte order", "not contiguous", "two dimensions"],
)
def test_json_takes_arrays_of_every_layout(array: np.ndarray[Any, Any]) -> None:
    values = json.loads(json_bytes({"a": array, "nan": math.nan}))
    assert values["nan"] is None
    assert np.array_equal(
        np.array(values["a"], dtype=float), np.where(np.isfinite(array), array, np.nan), equal_nan=True
    )


def test_json_of_odd_text_is_still_json() -> None:
    assert json.loads(json_bytes({"text": "lone \ud800 surrogate", 3: "number as a key"}))["3"] == "number as a key"


@pytest.mark.parametrize("value", [object(), {"a": {1, 2}}, {"a": 2**70}])
def test_what_cannot_be_json_says_so(value: object) -> None:
    with pytest.raises(Unencodable):
        json_bytes(value)


@pytest.mark.parametrize(
    ("dtype", "tag"),
    [("u2", 69), ("u4", 70), ("u8", 71), ("i1", 72), ("i2", 77), ("i4", 78), ("i8", 79), ("f4", 85), ("f8", 86)],
)
def test_cbor_has_little_endian_typed_arrays(dtype: str, tag: int) -> None:
    values = np.array([1, 2, 100], dtype=f">{dtype}")
    found = cbor2.loads(cbor_bytes({"a": values}))["a"]
    assert isinstance(found, cbor2.CBORTag)
    assert found.tag == tag
    assert np.array_equal(np.frombuffer(found.value, dtype=f"<{dtype}"), values)


def test_cbor_keeps_what_is_no_number_and_bytes() -> None:
    found = cbor2.loads(
        cbor_bytes({"ranges": NOT_NUMBERS, "x": -math.inf, "data": b"\x00\xff", "u": np.arange(2, dtype="u1")})
    )
    ranges = np.frombuffer(found["ranges"].value, dtype="<f4")
    assert np.array_equal(ranges, NOT_NUMBERS, equal_nan=True)
    assert (found["x"], found["data"], found["u"]) == (-math.inf, b"\x00\xff", b"\x00\x01")


@pytest.mark.parametrize("encoding", ["json", "cbor", "cbor-raw"])
def test_a_message_is_encoded_once_for_all_who_want_it(encoding: Encoding) -> None:
    content = {"x": 1.0}
    message = Outgoing(RosBridge(), "geometry_msgs/Vector3", content)
    first = message.frames("/t", encoding)
    content["x"] = 2.0  # a second encoding would show this
    assert message.frames("/t", encoding) is first
    body = first[first.rindex(b"msg") :]
    assert message.frames("t", encoding).endswith(body)  # another spelling of the topic


def test_a_frame_names_the_topic_as_the_client_does() -> None:
    message = Outgoing(RosBridge(), "geometry_msgs/Vector3", {"x": 1.0})
    text = message.frames('odd "topic"', "json")
    assert json.loads(text[2:]) == {"op": "publish", "topic": 'odd "topic"', "msg": {"x": 1.0}}
    binary = message.frames("ünusual", "cbor")
    assert cbor2.loads(binary[2:]) == {"op": "publish", "topic": "ünusual", "msg": {"x": 1.0}}
