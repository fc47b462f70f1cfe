"""What a line of the server's own log is about: the car, where the server has several, and the command."""

from __future__ import annotations

import re
import secrets
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

Handler = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]

_VEHICLE: ContextVar[str] = ContextVar("catgraph_vehicle", default="")
_TRACE: ContextVar[str] = ContextVar("catgraph_trace", default="")
_IS_TRACE = re.compile(r"[A-Za-z0-9_.-]{4,80}")


@contextmanager
def about(vehicle: str) -> Iterator[None]:
    """Lines that are logged within, and in tasks that are begun within, are about this car; "": about none."""
    token = _VEHICLE.set(vehicle)
    try:
        yield
    finally:
        _VEHICLE.reset(token)


def keeping(handler: Handler) -> Handler:
    """The handler; it logs for the car of this call's context, not of the handler's call."""
    vehicle = _VEHICLE.get()

    async def handle(message: Mapping[str, Any]) -> Mapping[str, Any]:
        with about(vehicle):
            return await handler(message)

    return handle


@contextmanager
def tracing(trace: object) -> Iterator[str]:
    """Lines that are logged within, and in tasks that are begun within, are about the command with this id, which is
    the same on its whole path. Yields it: a new one where it is none."""
    id = trace if isinstance(trace, str) and _IS_TRACE.fullmatch(trace) else secrets.token_hex(8)
    token = _TRACE.set(id)
    try:
        yield id
    finally:
        _TRACE.reset(token)


def trace() -> str:
    """The id of the command that this is about; "": of none."""
    return _TRACE.get()


def vehicle() -> str:
    """The car that this is about; "": none."""
    return _VEHICLE.get()


def with_context(line: str) -> str:
    """The line, and the car and the command that it is about where it does not name them itself."""
    for name, value in (("vehicle", _VEHICLE.get()), ("trace", _TRACE.get())):
        if value and f"{name}=" not in line:
            line = f"{line} {name}={value}"
    return line
