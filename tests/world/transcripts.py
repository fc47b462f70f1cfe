"""Reads the conversations with real rosbridge servers, line by line."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, cast

import pytest

from server.judge.message import RosVersion
from tests.tree import RECORDINGS

FOLDER = RECORDINGS / "rosbridge"
Kind = Literal["out", "in", "event", "note", "log", "received"]

needs_transcripts = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="the transcripts of real bridges are not on this machine"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a transcript. `frame` is text, or the bytes of a binary frame; `of` holds the other fields."""

    number: int
    at_s: float
    conn: str
    kind: Kind
    frame: str | bytes = ""
    text: str = ""
    of: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Transcript:
    name: str
    ros: RosVersion
    head: dict[str, Any]
    lines: tuple[Line, ...]


def names() -> list[str]:
    """Every transcript as ros1/NAME or ros2/NAME; none where they are not on this machine."""
    return sorted(str(path.relative_to(FOLDER).with_suffix("")) for path in FOLDER.glob("ros[12]/*.jsonl"))


@cache
def read(name: str) -> Transcript:
    """One transcript."""
    rows = [json.loads(line) for line in (FOLDER / f"{name}.jsonl").read_text(encoding="utf-8").splitlines()]
    ros = cast("RosVersion", int(name[3]))
    lines = tuple(_line(number, row) for number, row in enumerate(rows[1:], start=2))
    return Transcript(name=name, ros=ros, head=rows[0], lines=lines)


def _line(number: int, row: dict[str, Any]) -> Line:
    kind: Kind = (
        row["dir"] if "dir" in row else next(name for name in ("event", "note", "log", "received") if name in row)
    )
    frame = base64.b64decode(row["b64"]) if "b64" in row else row.get("text", "")
    text = row[kind] if kind in ("note", "log", "event") else ""
    return Line(number=number, at_s=row["t"], conn=row.get("conn", ""), kind=kind, frame=frame, text=text, of=row)
