"""Which car a line of the server's own log is about, where the server has several."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

Handler = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]

_VEHICLE: ContextVar[str] = ContextVar("catgraph_vehicle", default="")


@contextmanager
def about(vehicle: str) -> Iterator[None]:
    """Lines that are logged within, and in tasks that are begun within, are about this car; "": about none."""
    token = _VEHICLE.set(vehicle)
    try:
        yield
    finally:
        _VEHICLE.reset(token)


def keeping(handler: Handler) -> Handler:
    """The handler; what it logs is about the car that is meant where this is called, whoever calls the handler."""
    vehicle = _VEHICLE.get()

    async def handle(message: Mapping[str, Any]) -> Mapping[str, Any]:
        with about(vehicle):
            return await handler(message)

    return handle


def with_vehicle(line: str) -> str:
    """The line, and the car that it is about where it does not name it itself."""
    vehicle = _VEHICLE.get()
    return f"{line} vehicle={vehicle}" if vehicle and "vehicle=" not in line else line
