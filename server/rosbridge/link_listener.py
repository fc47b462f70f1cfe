"""The listener of a link's events, and its calls: a fault in one costs one message, and not the link."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Protocol

from server.rosbridge.connection_errors import Problem

log = logging.getLogger("catgraph.link")
NOTE = "note"  # the level of a status that is for the operators' log

MAX_FAULTS = 200  # different ones that are logged


class Marks(Protocol):
    """Who follows how late the link is."""

    def open(self, at_s: float) -> None: ...
    def took(self, size: int) -> None: ...
    def sent(self, at_s: float) -> None: ...
    def answered(self, sent_s: float, at_s: float) -> None: ...
    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None: ...


class LinkListener(Protocol):
    """Listener of a link's events; every method returns at once."""

    def link_opened(self) -> None: ...
    def link_closed(self, problem: Problem) -> None: ...
    def dial_failed(self, problem: Problem) -> None: ...
    def message_received(self, topic: str, message: Any, note: str | None) -> None: ...
    def status_received(self, level: str, text: str) -> None: ...
    def junk_received(self, why: str) -> None: ...
    def large_skipped(self, topic: str | None, size: int) -> None: ...


class SafeCalls:
    """Calls of a link's listener: a fault in one costs one message, and not the link.

    Of one link. `source`: its address, as it is logged.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._known: set[str] = set()
        self.is_stopped = False

    def notify(self, listener: Callable[..., None], *what: Any) -> bool:
        """Call the listener unless stopped; return False if it raised.

        Otherwise each such message would end the link and hide all others.
        """
        if self.is_stopped:
            return True
        try:
            listener(*what)
        except Exception as error:
            fault = f"{listener.__name__}: {type(error).__name__}"
            if fault not in self._known:
                self._known.add(fault)
                log.exception("handler failed (logged once): error=%s source=%s", fault, self._source)
            return False
        return True

    def is_new(self, text: str) -> bool:
        """Whether a text was not reported yet, and there are not too many."""
        if text in self._known or len(self._known) >= MAX_FAULTS:
            return False
        self._known.add(text)
        return True

    def log_once(self, text: str) -> None:
        if self.is_new(text):
            log.error("%s (%s)", text, self._source)
