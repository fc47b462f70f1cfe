"""How a line of the server's own log is written: one line for one event, whatever a car or a stranger put into it."""

from __future__ import annotations

import argparse
import datetime
import logging
import sys
import unicodedata
from typing import Any, Literal

import orjson

from server.system import log_context

FORMAT = "%(levelname)s %(name)s: %(message)s"
LONGEST = 4000  # letters of one message


class OneLine(logging.Formatter):
    """Characters that end a line, turn the direction of writing or steer a terminal are written as \\x1b or \\u202e.

    Where a fault is logged with its trace, each of its lines is indented, so that none can pass for a line of the log.
    """

    def formatMessage(self, record: logging.LogRecord) -> str:
        return _seen(log_context.with_context(super().formatMessage(record)))

    def formatException(self, ei: Any) -> str:
        return _set_in(super().formatException(ei))

    def formatStack(self, stack_info: str) -> str:
        return _set_in(super().formatStack(stack_info))


class JsonLine(logging.Formatter):
    """One object of JSON on one line; `vehicle` and `trace` where it is about a car or a command."""

    def format(self, record: logging.LogRecord) -> str:
        at = datetime.datetime.fromtimestamp(record.created, datetime.UTC)
        line = {
            "time": at.isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": _seen(record.getMessage()),
        }
        for name, value in (("vehicle", log_context.vehicle()), ("trace", log_context.trace())):
            if value:
                line[name] = value
        if record.exc_info:
            line["error"] = _seen(self.formatException(record.exc_info))
        return orjson.dumps(line).decode()


Format = Literal["text", "json"]
FORMATS: dict[Format, logging.Formatter] = {"text": OneLine(FORMAT), "json": JsonLine()}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--log-format", choices=tuple(FORMATS), default="text", help="of the lines on standard error")
    parser.add_argument(
        "--log-level", choices=("info", "warning"), default="warning", help="info: also a line for each command"
    )


def begin(format: Format = "text", level: str = "warning") -> None:
    """All of the process logs so, on the terminal's second stream; `level` is of our own lines."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(FORMATS[format])
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    logging.getLogger("catgraph").setLevel(level.upper())


def _set_in(text: str) -> str:
    return "\n".join(f"  | {_seen(line)}" for line in text.split("\n"))


def _seen(text: str) -> str:
    short = text if len(text) <= LONGEST else f"{text[:LONGEST]}… ({len(text)} letters)"
    if short.isprintable():
        return short
    return "".join(
        letter
        if letter.isprintable() or unicodedata.category(letter) == "Zs"
        else letter.encode("unicode_escape").decode()
        for letter in short
    )
