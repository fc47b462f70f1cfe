"""Puts states on the bus for the pages: at once, or soon, so that events go out before."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import orjson

from server.bus.bus import SessionBus
from server.protocol.state import LiveState

log = logging.getLogger("catgraph.session")

EVENTS_FIRST_S = 0.002  # a page's writer is woken some turns of the loop after its events are there


class StatePublisher:
    """The states of one vehicle. `make` makes the frame; `now` is a monotonic clock in seconds."""

    def __init__(
        self, vehicle: str, bus: SessionBus, make: Callable[[], LiveState], *, now: Callable[[], float]
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._make = make
        self._now = now
        self._failure = ""  # why no state can be made, as last logged
        self._put_s = now()
        self.is_due = False  # one is put soon

    def restart(self) -> None:
        """The age counts from now."""
        self._put_s = self._now()

    @property
    def age_s(self) -> float | None:
        """Since a state was made for the pages; None: no page is connected."""
        return self._now() - self._put_s if self._bus.watched(self._vehicle) else None

    def put_soon(self) -> None:
        """Once the events have gone out: they must not wait until a state is made. Several changes make one state."""
        if not self.is_due:
            self.is_due = True
            asyncio.get_running_loop().call_later(EVENTS_FIRST_S, self._put_due)

    def put(self) -> None:
        """Never raises: an order that was obeyed is not answered with an error because no state can be made. Pages
        that get none cover their values."""
        self.is_due = False
        try:
            if self._bus.watched(self._vehicle):
                made_s = self._now()  # before: this process may be stopped while it makes one
                self._bus.put(self._vehicle, "state", orjson.dumps(self._make()).decode(), made_s=made_s)
        except Exception as error:
            if self._failure != (failure := f"{type(error).__name__}: {error}"):
                self._failure = failure
                log.exception("state failed: vehicle=%s", self._vehicle)
        else:
            self._failure, self._put_s = "", self._now()

    def _put_due(self) -> None:
        if self.is_due:  # else one was put meanwhile
            self.put()
