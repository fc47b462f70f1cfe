"""A client's operations, read at the edge."""

from __future__ import annotations

import math
from typing import Any

import pytest

from server.rosbridge_server import fields
from server.rosbridge_server.fields import Refused


def test_python_s_bare_nan_is_taken_as_rosbridge_takes_it() -> None:
    found = fields.parse(b'{"op":"publish","msg":{"x":NaN,"y":-Infinity}}')
    assert math.isnan(found["msg"]["x"])
    assert found["msg"]["y"] == -math.inf


@pytest.mark.parametrize(
    ("raw", "why"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 2_000, "not JSON"),
        (b'{"a":NaN' + b"[" * 2_000, "not JSON"),
        (b'{"a":NaN,"b":' + b"9" * 5_000 + b"}", "not JSON"),
        (b"[]", "expected a JSON object with an op, got a list"),
        (b"null", "got null"),
        (b'"op"', "got text"),
        (b"3", "got the number 3"),
        (b"true", "got true"),
    ],
)
def test_what_is_no_operation_is_named(raw: bytes, why: str) -> None:
    with pytest.raises(Refused, match=why):
        fields.parse(raw)


@pytest.mark.parametrize("id", ["a", "", 7, 1.5, None])
def test_an_id_is_text_or_a_number(id: object) -> None:
    assert fields.id_of({"id": id}) == id


@pytest.mark.parametrize("id", [True, [], {}, "x" * 1_001])
def test_other_ids_are_refused(id: object) -> None:
    with pytest.raises(Refused, match="the id"):
        fields.id_of({"id": id})


@pytest.mark.parametrize("value", [-1, True, "5", [], {}, math.nan, math.inf, 2**60])
def test_a_count_must_be_a_number_of_sensible_size(value: Any) -> None:
    with pytest.raises(Refused, match="queue_length must be a number, 0 or more"):
        fields.whole_number({"queue_length": value}, "queue_length", 0)


def test_fields_have_defaults_or_must_be_there() -> None:
    assert fields.whole_number({"n": 2.9}, "n") == 2
    assert fields.whole_number({"n": None}, "n", 5) == 5
    assert fields.whole_number({}, "n", 5) == 5
    assert fields.optional_text({"type": None}, "type") is None
    with pytest.raises(Refused, match="expected a field topic, but there is none"):
        fields.text({}, "topic")
    with pytest.raises(Refused, match="topic must be text, got an object"):
        fields.text({"topic": {}}, "topic")


def test_a_complaint_is_never_long() -> None:
    assert len(str(Refused("x" * 10_000))) < 500
