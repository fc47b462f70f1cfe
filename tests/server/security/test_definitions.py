"""Message definitions from a bridge or a file are bounded before they are parsed and before code is made of them."""

from __future__ import annotations

import time

import pytest

from server.recording.read.decode import compile_decoder
from server.recording.read.definitions import definitions_of
from server.recording.read.errors import Undecodable
from server.recording.read.schemas import TypeBook
from server.recording.read.source import Channel

pytestmark = pytest.mark.world(n=21)

_SEPARATOR = "=" * 80


def doubling(levels: int) -> str:
    parts = [f"MSG: a/T{n}\na/T{n + 1} x\na/T{n + 1} y" for n in range(1, levels)]
    return f"\n{_SEPARATOR}\n".join(["a/T1 x\na/T1 y", *parts, f"MSG: a/T{levels}\nfloat32 z"])


HOSTILE = {
    "doubling 14 times": doubling(14),
    "doubling 30 times": doubling(30),
    "many fields": "".join(f"float32 f{n}\n" for n in range(12_000)),
    "one long line": "float32" + " " * 200_000 + "x\n",
    "a long text": "string S=" + "a" * 200_000,
    "no fields": "float32 " * 30_000,
    "many types": (_SEPARATOR + "\n") * 3000 + "float32 x\n",
    "a long length": "float32[" + "9" * 5000 + "] x\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_definition_is_refused_at_once(name: str) -> None:
    book = TypeBook(1)
    book.learn({"a/T0": HOSTILE[name]})
    channel = Channel(
        number=1,
        topic="/x",
        type="a/msg/T0",
        definition=HOSTILE[name],
        format="msg",
        encoding="ros1",
        count=1,
        is_latched=False,
    )
    began_s = time.thread_time()
    assert book.schema("a/T0") is None, "recorded as JSON"
    with pytest.raises(Undecodable):
        compile_decoder("a/msg/T0", definitions_of(channel, 1, None), 1)
    assert time.thread_time() - began_s < 2.0


def test_blank_lines_and_comments_cost_nothing() -> None:
    book = TypeBook(1)
    book.learn({"a/T0": "\n" * 100_000 + "# nothing\n" * 10_000 + "float32 x  # metres\nstring S=a#b\n"})
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
