"""Message definitions from a bridge or a file are bounded before they are parsed and before code is made of them."""

from __future__ import annotations

import time

import pytest

from server.recording.read import definitions
from server.recording.read.decode import compile_decoder
from server.recording.read.definitions import MAX_LINE, definitions_of
from server.recording.read.errors import Undecodable
from server.recording.read.schemas import TypeBook
from server.recording.read.source import Channel

pytestmark = pytest.mark.world(n=21)

_SEPARATOR = "=" * 80


def doubling(levels: int) -> str:
    parts = [f"MSG: a/T{n}\na/T{n + 1} x\na/T{n + 1} y" for n in range(1, levels)]
    return f"\n{_SEPARATOR}\n".join(["a/T1 x\na/T1 y", *parts, f"MSG: a/T{levels}\nfloat32 z"])


BEYOND = {
    "fields of messages in it": doubling(4),
    "many fields": "".join(f"float32 f{n}\n" for n in range(31)),
    "one long line": "float32" + " " * MAX_LINE + "x\n",
    "a long text": "string S=" + "a" * MAX_LINE,
    "many lines": "int8 A=1\n" * 101 + "float32 x\n",
}


@pytest.mark.parametrize("name", BEYOND)
def test_a_definition_beyond_a_bound_is_refused(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With bounds of 100 lines and 30 fields."""
    monkeypatch.setattr(definitions, "MAX_LINES", 100)
    monkeypatch.setattr(definitions, "MAX_FIELDS", 30)
    book = TypeBook(1)
    book.learn({"a/T0": BEYOND[name]})
    channel = Channel(
        number=1,
        topic="/x",
        type="a/msg/T0",
        definition=BEYOND[name],
        format="msg",
        encoding="ros1",
        count=1,
        is_latched=False,
    )
    assert book.schema("a/T0") is None, "recorded as JSON"
    with pytest.raises(Undecodable):
        compile_decoder("a/msg/T0", definitions_of(channel, 1, None), 1)


def test_blank_lines_and_comments_cost_nothing() -> None:
    book = TypeBook(1)
    book.learn({"a/T0": "\n" * 10_000 + "# nothing\n" * 10_000 + "float32 x  # metres\nstring S=a#b\n"})
    began_s = time.thread_time()
    schema = book.schema("a/T0")
    assert time.thread_time() - began_s < 1.0
    assert schema is not None
    assert schema.encode is not None
    assert schema.encode({"x": 1.0}) == b"\x00\x00\x80\x3f"
    assert b"# metres" in schema.data, "it is kept as it came"


def test_a_large_honest_definition_is_taken() -> None:
    book = TypeBook(1)
    book.learn({"a/T0": "".join(f"float64 field_{n}\n" for n in range(500))})
    assert book.schema("a/T0") is not None
