"""The connection of one car: the phase of its monitoring, the dialling, and the proof that a rosbridge answers."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from monitor.state import Phase
from server.rosbridge import connection_errors
from server.rosbridge.address import Address, BadAddress
from server.rosbridge.connection_errors import Problem
from server.rosbridge.link_listener import NOTE, Marks
from server.rosbridge.live_source import LiveSource, OpenSource
from server.rosbridge.raw_frame import RawFrame
from server.system.supervision import Supervisor
from server.vehicle.subscriptions import Subscriptions

log = logging.getLogger("catgraph.connection")

PROOF_WITHIN_S = 4.0  # by then a WebSocket server without rosbridge is recognized
BRIDGE_SILENT_S = 1.4  # the bridge answers a ping every 0.5 s


class ConnectionObserver(Protocol):
    """What a connection reports; every method returns at once."""

    def connection_opened(self, link: LiveSource) -> None:
        """The car is monitored over this link, for the first time or again."""

    def connection_proved(self) -> None:
        """The first operation of a rosbridge came."""

    def connection_closed(self) -> None:
        """The WebSocket to the bridge is gone."""

    def connection_lost(self, problem: Problem) -> None:
        """A monitored car is out of reach, because of this problem."""

    def connection_changed(self, now_s: float) -> None:
        """Phase or problem changed."""


class MessageHandler(Protocol):
    """What takes the frames of a link."""

    def link_opened(self) -> None:
        """Nothing has come yet over this opening."""

    def frame_received(self, frame: RawFrame) -> bool:
        """Takes a frame as it came; False: it has to be parsed."""

    def message_received(self, topic: str, message: Any, note: str | None) -> None: ...
    def junk_received(self, why: str) -> None: ...


class Connection:
    """Of one car at a time, over any number of openings. `now` is a monotonic clock in seconds."""

    def __init__(
        self,
        name: str,
        observer: ConnectionObserver,
        messages: MessageHandler,
        subscriptions: Callable[[LiveSource | None], Subscriptions],
        open_source: OpenSource,
        supervisor: Supervisor,
        *,
        now: Callable[[], float],
    ) -> None:
        """`subscriptions` makes those of a link, or of no car where it is None."""
        self._name = name
        self._observer = observer
        self._messages = messages
        self._make_subscriptions = subscriptions
        self._open_source = open_source
        self._supervisor = supervisor
        self._now = now
        self.phase: Phase = "idle"
        self.reset()

    def reset(self) -> None:
        """Forgets one connection's facts before another begins."""
        self.phase = "idle"
        self.address: Address | None = None
        self.link: LiveSource | None = None
        self.problem: Problem | None = None
        self.since_s = self._now()  # since when the phase is what it is
        self.dialled_s = self._now()
        self.connected_s: float | None = None  # since when it is known to be a rosbridge
        self.subscriptions = self._make_subscriptions(None)

    def dial(self, target: Address, marks: Marks) -> None:
        """Begins to dial; to be called after `reset`."""
        self.phase, self.address = "connecting", target
        self.link = self._open_source(
            target, self, now=self._now, take_unparsed=self._messages.frame_received, marks=marks
        )
        self.subscriptions = self._make_subscriptions(self.link)
        self.link.start()

    def drop(self, *, is_flushed: bool = False) -> None:
        """Closes the link. `is_flushed`: what was just sent leaves before."""
        self.subscriptions.end()
        if self.link is not None:
            self.link.stop(is_flushed=is_flushed)
            self.link = None

    def refuse(self, why: BadAddress) -> bool:
        """Report an address that cannot be dialled; return whether the phase shows it: while no car is monitored."""
        if self.phase not in ("idle", "failed"):
            return False
        self.phase, self.problem = "failed", connection_errors.of_bad_address(why)
        return True

    @property
    def is_proved(self) -> bool:
        return self.connected_s is not None

    def bridge_answers(self, now_s: float) -> bool:
        link = self.link
        return link is not None and link.is_open and link.heard_s is not None and now_s - link.heard_s < BRIDGE_SILENT_S

    def prove(self) -> None:
        """The first operation of rosbridge: this is one."""
        if not self.is_proved:
            self.connected_s = self._now()
            self._observer.connection_proved()
        if self.phase != "monitoring" and self.link is not None and self.link.is_open:
            self._reopened(self.link)

    # -- LinkListener ------------------------------------------------------------------------------------------------

    def link_opened(self) -> None:
        link = self.link
        assert link is not None
        self._messages.link_opened()
        if self.phase == "connecting" or not self.is_proved:
            self._supervisor.keep("proof", partial(self._demand_proof, link), may_end=True)
        if self.is_proved:
            self._reopened(link)
        self._supervisor.keep("subscriptions", self.subscriptions.run, may_end=True)

    def link_closed(self, problem: Problem) -> None:
        now_s = self._now()
        self._observer.connection_closed()
        if problem.code == connection_errors.BRIDGE_SILENT:
            self.subscriptions.fell_silent()
        if self.is_proved:
            self.problem = problem
            if self.phase != "lost":
                self.phase, self.since_s = "lost", now_s
                self._observer.connection_lost(problem)
        elif self.address is not None and self.phase != "failed":
            self.phase = "failed"
            software = self.link.server_software if self.link is not None else ""
            is_named = problem.code == connection_errors.LOGIN_WANTED or software.startswith(
                connection_errors.ROSBRIDGE_SERVERS
            )
            closes = connection_errors.not_rosbridge(self.address, "It closes the connection.")
            self.problem = problem if is_named else closes
        self.dialled_s = now_s
        self._observer.connection_changed(now_s)

    def dial_failed(self, problem: Problem) -> None:
        now_s = self._now()
        if self.phase in ("connecting", "failed"):
            if self.phase == "connecting":
                self.since_s = now_s
            self.phase = "failed"
        elif problem.code == connection_errors.NOT_EXPECTED and self.address is not None:
            problem = connection_errors.bridge_silent(self.address)  # it was a rosbridge before: it hangs
        self.problem = problem
        self._observer.connection_changed(now_s)

    def status_received(self, level: str, text: str) -> None:
        self.prove()
        log.info("bridge status: vehicle=%s level=%s text=%s", self._name, level, text)
        if level == NOTE:
            self.subscriptions.noted(text)
        elif level == "error":
            self.subscriptions.bridge_complains(text)

    def junk_received(self, why: str) -> None:
        self._messages.junk_received(why)

    def large_skipped(self, topic: str | None, size: int) -> None:
        self.subscriptions.skipped(topic, size)

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        self._messages.message_received(topic, message, note)

    async def _demand_proof(self, link: LiveSource) -> None:
        """Give up a WebSocket that sends no rosbridge operation."""
        await asyncio.sleep(PROOF_WITHIN_S)
        if link is self.link and link.is_open and not self.is_proved and self.address is not None:
            self.phase = "failed"
            self.problem = connection_errors.not_proved(self.address, link.server_software, link.junk_count)
            link.abort()
            self._observer.connection_changed(self._now())

    def _reopened(self, link: LiveSource) -> None:
        now_s = self._now()
        self.phase, self.since_s, self.problem = "monitoring", now_s, None
        self._observer.connection_opened(link)
        self._observer.connection_changed(now_s)
