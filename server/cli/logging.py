"""How a line of the server's own log is written: one line for one event, whatever a car or a stranger put into it."""

from __future__ import annotations

import logging
import sys
import unicodedata
from typing import Any

from server.system.log_context import with_vehicle

FORMAT = "%(levelname)s %(name)s: %(message)s"
LONGEST = 4000  # letters of one message


class OneLine(logging.Formatter):
    """Signs that end a line, turn the direction of writing or steer a terminal stand as \\x1b or \\u202e; where a fault
    is told with its trace, each line of it is set in, so that no line of it can pass for a line of the log."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        return _seen(with_vehicle(super().formatMessage(record)))

    def formatException(self, told: Any) -> str:
        return _set_in(super().formatException(told))

    def formatStack(self, stack_info: str) -> str:
        return _set_in(super().formatStack(stack_info))


def begin() -> None:
    """All of the process logs so, on the terminal's second stream."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(OneLine(FORMAT))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])


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
