"""One event is one line, of whatever origin the text in it is."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import sys
import threading
from collections.abc import Mapping
from contextvars import copy_context
from datetime import datetime
from typing import Any

import pytest

from server.cli.logging import FORMAT, LONGEST, JsonLine, OneLine
from server.system.log_context import about, keeping, tracing


def written(message: str, *arguments: object, fault: BaseException | None = None) -> str:
    ei = (type(fault), fault, fault.__traceback__) if fault is not None else None
    return OneLine(FORMAT).format(logging.LogRecord("catgraph.x", logging.ERROR, "f", 1, message, arguments, ei))


@pytest.mark.parametrize(
    ("text", "stands"),
    [
        ("/scan", "/scan"),
        ("Büro – 5 m², ü", "Büro – 5 m², ü"),
        ("a\nERROR catgraph.app: all is well", "a\\nERROR catgraph.app: all is well"),
        ("a\r\nb", "a\\r\\nb"),
        ("\x1b[2Jgone", "\\x1b[2Jgone"),
        ("a\0b\x85c\u2028d", "a\\x00b\\x85c\\u2028d"),
        ("\u202etxt.exe", "\\u202etxt.exe"),
        ("half \ud800", "half \\ud800"),
        ("x" * (LONGEST + 5), "x" * (LONGEST - len("ERROR catgraph.x: ")) + f"… ({LONGEST + 23} letters)"),
    ],
)
def test_a_message_is_one_line(text: str, stands: str) -> None:
    assert written("%s", text) == f"ERROR catgraph.x: {stands}"


def test_no_line_of_a_trace_passes_for_a_line_of_the_log() -> None:
    try:
        raise ValueError("a\nERROR catgraph.app: forged \x1b[2J")
    except ValueError:
        lines = written("it failed", fault=sys.exc_info()[1]).split("\n")
    assert lines[0] == "ERROR catgraph.x: it failed"
    assert len(lines) > 3
    assert all(line.startswith("  | ") for line in lines[1:])
    assert any("forged \\x1b[2J" in line for line in lines)


async def test_a_line_names_its_car_also_from_a_handler_and_a_thread() -> None:
    found: list[str] = []

    async def handle(message: Mapping[str, Any]) -> Mapping[str, Any]:
        await asyncio.create_task(note("from a task"))
        return message

    async def note(text: str) -> None:
        found.append(written(text))

    with about("ocelot"):
        handler = keeping(handle)
        await note("check failed")
        await note("restarted: vehicle=serval")
        thread = threading.Thread(target=copy_context().run, args=(lambda: found.append(written("slow disk")),))
        thread.start()
        thread.join()
    with about(""):
        await note("a server of one car")
    with about("serval"):
        await handler({})
    await note("the server itself")
    assert found == [
        "ERROR catgraph.x: check failed vehicle=ocelot",
        "ERROR catgraph.x: restarted: vehicle=serval",
        "ERROR catgraph.x: slow disk vehicle=ocelot",
        "ERROR catgraph.x: a server of one car",
        "ERROR catgraph.x: from a task vehicle=ocelot",
        "ERROR catgraph.x: the server itself",
    ]


def test_a_line_of_json_names_car_and_command() -> None:
    record = logging.LogRecord("catgraph.x", logging.INFO, "f", 1, "command kind=%s", ("a\n\u202eb",), None)
    with about("ocelot"), tracing("8f00ba12-7"):
        found = json.loads(JsonLine().format(record))
        text = OneLine(FORMAT).format(record)
    assert text == "INFO catgraph.x: command kind=a\\n\\u202eb vehicle=ocelot trace=8f00ba12-7"
    datetime.fromisoformat(found.pop("time"))
    assert found == {
        "level": "info",
        "logger": "catgraph.x",
        "message": "command kind=a\\n\\u202eb",
        "vehicle": "ocelot",
        "trace": "8f00ba12-7",
    }
    try:
        raise ValueError("no\x1b")
    except ValueError:
        record.exc_info = sys.exc_info()
    found = json.loads(JsonLine().format(record))
    assert "ValueError: no\\x1b" in found["error"]
    assert "trace" not in found


@pytest.mark.parametrize("trace", [None, 7, "a b c d", "x", "\n" * 9, "x" * 81])
def test_an_id_of_a_command_that_is_none_is_replaced(trace: object) -> None:
    with tracing(trace) as id:
        assert re.fullmatch(r"[0-9a-f]{16}", id)
