"""One event is one line, whoever wrote the words in it."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
from collections.abc import Mapping
from contextvars import copy_context
from typing import Any

import pytest

from server.cli.logging import FORMAT, LONGEST, OneLine
from server.system.log_context import about, keeping


def written(message: str, *arguments: object, fault: BaseException | None = None) -> str:
    told = (type(fault), fault, fault.__traceback__) if fault is not None else None
    return OneLine(FORMAT).format(logging.LogRecord("catgraph.x", logging.ERROR, "f", 1, message, arguments, told))


@pytest.mark.parametrize(
    ("said", "stands"),
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
def test_a_message_is_one_line(said: str, stands: str) -> None:
    assert written("%s", said) == f"ERROR catgraph.x: {stands}"


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
