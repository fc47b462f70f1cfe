"""Compares what is sent with the types of server/protocol: nothing missing, nothing more, each value of its type."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any

from pydantic import TypeAdapter

from server.protocol.messages import Message


@cache
def _adapter(shape: Any) -> TypeAdapter[Any]:
    return TypeAdapter(shape)


def check_frame(text: str | bytes) -> None:
    """A text frame of the server must be one of the messages. Raises AssertionError."""
    check_shape(text, Message)


def check_shape(text: str | bytes, shape: Any) -> None:
    """JSON must be of the type `shape`, and hold no other key. Raises AssertionError, ValidationError."""
    adapter = _adapter(shape)
    known = adapter.dump_python(adapter.validate_json(text, strict=True), mode="json")
    more = list(_unknown(json.loads(text), known))
    assert more == [], f"not in the type: {', '.join(more)}"


def _unknown(sent: Any, known: Any, place: str = "") -> Iterator[str]:
    """The keys that only `sent` has."""
    if isinstance(sent, dict) and isinstance(known, dict):
        for name, value in sent.items():
            if name not in known:
                yield f"{place}.{name}"
            else:
                yield from _unknown(value, known[name], f"{place}.{name}")
    elif isinstance(sent, list) and isinstance(known, list):
        for at, (one, other) in enumerate(zip(sent, known, strict=True)):
            yield from _unknown(one, other, f"{place}[{at}]")
