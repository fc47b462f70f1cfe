"""What comes over the wire is a rosbridge operation, or is refused with a short reason; nothing else."""

from __future__ import annotations

import json
import math
import time
from typing import Any

import cbor2
import numpy as np
import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.rosbridge import codec
from server.rosbridge.codec import MAX_DEPTH, Unreadable


def nested(depth: int) -> bytes:
    """An object whose innermost list stands in `depth` others."""
    return b'{"op":' + b"[" * depth + b"]" * depth + b"}"


GOOD = {
    "empty object": (b"{}", {}),
    "publish": (
        b'{"op":"publish","topic":"/a","msg":{"data":1.5}}',
        {"op": "publish", "topic": "/a", "msg": {"data": 1.5}},
    ),
    "null": (b'{"msg":{"data":null}}', {"msg": {"data": None}}),
    "space around": (b' \r\n{"op":"status"}\n', {"op": "status"}),
    "more than 64 bits": (b'{"a":18446744073709551616}', {"a": 18446744073709551616.0}),
    "as deep as may be": (nested(MAX_DEPTH), json.loads(nested(MAX_DEPTH))),
    "many brackets side by side": (b'{"a":[' + b"{}," * 500 + b"{}]}", {"a": [{}] * 501}),
    "brackets in text": (orjson.dumps({"a": "[" * 500}), {"a": "[" * 500}),
}


@pytest.mark.parametrize(("payload", "operation"), GOOD.values(), ids=GOOD)
def test_json_is_read_without_a_note(payload: bytes, operation: dict[str, Any]) -> None:
    assert codec.decode(payload, is_binary=False) == (operation, None)


def test_bare_tokens_are_read_and_noted() -> None:
    operation, note = codec.decode(b'{"c":[NaN,0.5,Infinity,-Infinity,-1,12345678901234567890]}', is_binary=False)
    assert note == "bare NaN or Infinity, read as unknown"
    assert math.isnan(operation["c"][0])
    assert operation["c"][1:] == [0.5, math.inf, -math.inf, -1, 12345678901234567890]
    assert [type(number) for number in operation["c"]] == [float, float, float, float, int, int]


def test_the_lax_reader_agrees_with_the_strict_one_on_whole_numbers() -> None:
    for number in (0, -1, 10**18, 2**63 - 1, 2**63, -(2**63), -(2**63) - 1, 2**64 - 1, 2**64, 10**300):
        strict, _ = codec.decode(b'{"a":%d}' % number, is_binary=False)
        lax, _ = codec.decode(b'{"a":%d,"b":NaN}' % number, is_binary=False)
        assert (type(lax["a"]), lax["a"]) == (type(strict["a"]), strict["a"])


BAD = {
    "nothing": (b"", "text that is not JSON"),
    "noise": (b"\x00\x01\xff\xfe", "text that is not JSON"),
    "no JSON": (b"hello", "text that is not JSON"),
    "cut off": (b'{"op":"publish","msg":{', "text that is not JSON"),
    "two objects": (b"{}{}", "text that is not JSON"),
    "not UTF-8": (b'{"a":"\xff"}', "text that is not JSON"),
    "UTF-16": ('{"a":1}'.encode("utf-16"), "text that is not JSON"),
    "half a character": (b'{"a":"\\ud800"}', "text that is not JSON"),
    "half a character beside a bare NaN": (b'{"a":"\\ud800","b":NaN}', "text that is not JSON"),
    "UTF-16 with a bare NaN": ('{"a":NaN}'.encode("utf-16-le") + b"NaN", "text that is not JSON"),
    "noise with a bare NaN": (b"\xff NaN", "text that is not JSON"),
    "a number beyond floats": (b'{"a":1e999,"b":NaN}', "text that is not JSON"),
    "a whole number beyond floats": (b'{"a":%s,"b":NaN}' % (b"9" * 5000), "text that is not JSON"),
    "list": (b"[]", "a frame that is not an object"),
    "list of operations": (b'[{"op":"publish"}]', "a frame that is not an object"),
    "text": (b'"op"', "a frame that is not an object"),
    "number": (b"1", "a frame that is not an object"),
    "null": (b"null", "a frame that is not an object"),
    "bare NaN": (b"NaN", "a frame that is not an object"),
    "too deep": (nested(MAX_DEPTH + 1), "a frame that nests too deep"),
    "objects too deep": (
        b'{"a":' * (MAX_DEPTH + 2) + b"1" + b"}" * (MAX_DEPTH + 2),
        "a frame that nests too deep",
    ),
    "too many parts": (b"[" + b"[]," * codec.MAX_CONTAINERS + b"1]", "a message with too many parts"),
    "too many parts with a bare NaN": (
        b"[NaN," + b"[]," * codec.MAX_CONTAINERS + b"1]",
        "a message with too many parts",
    ),
    "200 deep with a bare NaN": (b'{"a":NaN,"b":' + b"[" * 200 + b"]" * 200 + b"}", "a frame that nests too deep"),
}


@pytest.mark.parametrize(("payload", "why"), BAD.values(), ids=BAD)
def test_text_is_refused(payload: bytes, why: str) -> None:
    with pytest.raises(Unreadable) as refusal:
        codec.decode(payload, is_binary=False)
    assert str(refusal.value) == why


TYPED_ARRAYS = {
    "|u1": 64, "|i1": 72, "<u2": 69, "<i2": 77, "<u4": 70, "<i4": 78, "<u8": 71, "<i8": 79,
    "<f2": 84, "<f4": 85, "<f8": 86, ">u2": 65, ">i4": 74, ">f4": 81, ">f8": 82,
}  # fmt: skip


@pytest.mark.parametrize(("kind", "tag"), TYPED_ARRAYS.items())
def test_typed_arrays_are_numpy_arrays(kind: str, tag: int) -> None:
    """Tags of RFC 8746."""
    numbers = np.array([0, 1, 100], dtype=kind)
    payload = cbor2.dumps({"msg": {"ranges": cbor2.CBORTag(tag, numbers.tobytes())}})
    operation, note = codec.decode(payload, is_binary=True)
    assert note is None
    assert operation["msg"]["ranges"].dtype == np.dtype(kind)
    assert operation["msg"]["ranges"].tolist() == [0, 1, 100]


def test_cbor_keeps_what_json_flattens() -> None:
    operation, _ = codec.decode(cbor2.dumps({"a": [math.inf, -math.inf, math.nan], "b": b"\x02", "c": None}), True)
    assert operation["a"][:2] == [math.inf, -math.inf]
    assert math.isnan(operation["a"][2])
    assert (operation["b"], operation["c"]) == (b"\x02", None)


def head(major: int, length: int) -> bytes:
    return bytes([major << 5 | 27]) + length.to_bytes(8, "big")


REFUSED = {
    "nothing": b"",
    "noise": b"\xff\xfe\xfd",
    "JSON in a binary frame": b'{"op":"publish"}',
    "a list that is too short": head(4, 2) + b"\x00",
    "a map that is too short": head(5, 2) + b"\x61a\x00",
    "bytes that are too short": head(2, 2) + b"x",
    "text that is too short": head(3, 2) + b"x",
    "one list too deep": b"\xa1\x61a" + b"\x81" * codec.MAX_DEPTH + b"\x00",
    "one list without an end too deep": b"\xa1\x61a" + b"\x9f" * codec.MAX_DEPTH + b"\xff" * codec.MAX_DEPTH,
    "one tag too deep": b"\xa1\x61a" + b"\xd9\x20\x00" * codec.MAX_DEPTH + b"\x00",
    "a list by reference": cbor2.dumps({"a": [shared := ["x"], shared]}, value_sharing=True),
    "text by reference": b"\xd9\x01\x00\x82\x63abc\xd8\x19\x00",
    "a number of nine bytes": b"\xa1\x61a\xc2" + head(2, 9) + b"\xff" * 9,
    "a decimal fraction": b"\xa1\x61a\xc4\x82\x01\x01",
    "a binary fraction": b"\xa1\x61a\xc5\x82\x01\x01",
    "a fraction": b"\xa1\x61a\xd8\x1e\x82\x01\x02",
    "a pattern": b"\xa1\x61a\xd8\x23\x62ab",
    "a letter": b"\xa1\x61a\xd8\x24\x60",
    "a date": b"\xa1\x61a\xc1\x00",
    "a set": b"\xa1\x61a\xd9\x01\x02\x81\x01",
    "a list as a key": b"\xa1\x81\x01\x01",
    "a number as a key": b"\xa1\x01\x01",
    "an array as a key": b"\xa1\xd8\x55\x44\x00\x00\x80\x3f\x01",
    "half an element": cbor2.dumps({"a": cbor2.CBORTag(85, b"\x00\x00\x00")}),
    "text that is not UTF-8": b"\xa1\x61a\x61\xff",
    "half a character": b"\xa1\x61a\x63\xed\xa0\x80",
}


@pytest.mark.field
@pytest.mark.parametrize("payload", REFUSED.values(), ids=REFUSED)
def test_binary_is_refused_at_once(payload: bytes) -> None:
    began_s = time.perf_counter()
    with pytest.raises(Unreadable, match=r"binary noise|too many parts"):
        codec.decode(payload, is_binary=True)
    assert time.perf_counter() - began_s < 0.5


@pytest.mark.parametrize("payload", [cbor2.dumps(value) for value in (1, "op", [1], None, b"x")])
def test_binary_that_is_no_object_is_refused(payload: bytes) -> None:
    with pytest.raises(Unreadable, match="a frame that is not an object"):
        codec.decode(payload, is_binary=True)


def read(payload: bytes, *, is_binary: bool) -> dict[str, Any] | None:
    try:
        return codec.decode(payload, is_binary)[0]
    except Unreadable:
        return None


@settings(deadline=None)
@given(payload=st.binary(max_size=200), is_binary=st.booleans())
def test_noise_is_refused_or_an_object(payload: bytes, is_binary: bool) -> None:
    assert isinstance(read(payload, is_binary=is_binary), dict | None)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=20,
)


@settings(deadline=None)
@given(st.dictionaries(st.text(max_size=4), json_values, max_size=5))
def test_what_is_read_can_be_written_again(operation: dict[str, Any]) -> None:
    """Python writes Infinity bare, as ROS 2 bridges do: both readers are tried."""
    found = read(json.dumps(operation).encode(), is_binary=False)
    assert found is not None
    assert codec.encode(found) == codec.encode(operation)


def test_encode_turns_unknown_numbers_into_null() -> None:
    operation = {"op": "publish", "msg": {"a": math.nan, "b": np.array([1.0, np.inf], dtype=np.float32)}}
    assert codec.encode(operation) == b'{"op":"publish","msg":{"a":null,"b":[1.0,null]}}'
