"""The contract between sessions and pages: newest frames by key, numbered events, requests with a deadline.

A session uses a `SessionBus`, a page's handler a `PageBus`; neither depends on the other,
nor on whether they share a process.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from server.bus.log_runs import Resumed

Handler = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]
Watcher = Callable[[str], None]
ALL = ""  # in the place of a vehicle, whose name is never empty: what is of all of them
SUMMARY = "summary"  # what a session puts for the pages of other cars, in `ALL` under the vehicle's name
UNSERVED = "unserved"  # to a watcher: nothing comes from the vehicle's session
FRAME_LIVES_S = 2.0  # an older frame is outdated: its session has stopped


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Bytes ready to send, made once for all pages.

    `put_s`: when what it holds was so, by the clock of this process in seconds; where it came from another one, it was
    not put earlier than that.
    """

    number: int
    payload: str | bytes
    put_s: float


Outcome = Literal["not_delivered", "unknown"]
Cut = Literal["server-broker", "broker-agent"]  # where the path to the session is broken


class NotServed(LookupError):
    """No session serves the vehicle, or it did not answer in time; `str()` is the reason.

    `outcome`: a command was not delivered and never will be, or it may have been carried out.
    """

    def __init__(self, why: str, *, outcome: Outcome = "not_delivered", cut: Cut | None = None) -> None:
        super().__init__(why)
        self.outcome = outcome
        self.cut = cut


class NotAdmitted(PermissionError):
    """The vehicle does not carry out what was passed on to it in somebody's name; `str()` is one sentence."""


class SessionBus(Protocol):
    """What a session needs: to publish, to serve, and to know whether anybody looks."""

    def put(self, vehicle: str, kind: str, payload: str | bytes, *, made_s: float | None = None) -> None:
        """Replaces the newest frame of a kind and wakes those who watch the vehicle.

        `made_s`: when what it holds was so, by the clock of this process: it may have been stopped before the frame was
        put. None: now.
        """

    def append(self, vehicle: str, events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Numbers events and returns them with their numbers `n`; pages are woken once they may have them."""

    def past_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """As `Journal.find`; for the start of a session, as it waits for the disk."""

    def logged_alarms(self, vehicle: str) -> list[str]:
        """The ids of all alarms that any event was ever of; for the start of a session, as it waits for the disk."""

    def last_event(self, vehicle: str) -> int:
        """The number of the newest event that pages may have."""

    def save_events(self) -> str | None:
        """Tries again to keep what the disk refused; why events are not kept, as a sentence, or None."""

    @property
    def log_complaint(self) -> str | None:
        """What was wrong with the log when the server started, and was put right."""

    def serve(self, vehicle: str, handler: Handler) -> None:
        """Register `handler` for requests to the vehicle."""

    def watched(self, vehicle: str) -> int:
        """The number of viewers of the vehicle."""

    def wanted(self, vehicle: str, kind: str) -> bool:
        """Whether any viewer wants this kind of frame, which is built only then."""


class PageBus(Protocol):
    """What a page's handler needs: to read, to send requests, and to state which frames it shows."""

    def newest(self, vehicle: str, kind: str) -> Frame | None:
        """The newest frame of a kind; None where there is none that is younger than `FRAME_LIVES_S`."""

    def put(self, vehicle: str, kind: str, payload: str | bytes) -> None:
        """For `ALL` only: a frame that this process composes of what it has of all vehicles."""

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]] | None:
        """The events after number `n` that pages may have, from memory; None where they must be read."""

    async def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        """The events after number `n` that pages may have, in order, at most `limit`."""

    async def find_events(self, vehicle: str, **filters: Any) -> list[dict[str, Any]]:
        """As `Journal.find`: all there are, whether or not the disk has them yet."""

    def last_event(self, vehicle: str) -> int:
        """The number of the newest event that pages may have."""

    @property
    def vehicles(self) -> tuple[str, ...]:
        """The vehicles that are served."""

    @property
    def grows(self) -> bool:
        """Whether vehicles may be added while it runs."""

    def trouble(self, vehicle: str) -> str | None:
        """Why nothing comes from the vehicle's session, as a sentence; None: it is there.

        While there is a trouble, watchers are called with `UNSERVED` twice a second.
        """

    def knows(self, vehicle: str) -> bool:
        """Whether it is known which events the vehicle has; before, pages of it are not greeted."""

    def run(self, vehicle: str) -> str:
        """In which run of a server the vehicle's events are numbered; "": nothing was received from it yet."""

    async def resume(self, vehicle: str, run: str, n: int) -> Resumed:
        """Where a reader continues who has read up to `n` in another `run`. Raises NotServed."""

    async def request(
        self, vehicle: str, command: Mapping[str, Any], *, deadline_s: float = 3.0, comes_within_s: float | None = None
    ) -> Mapping[str, Any]:
        """The answer to a command, once the events that it caused may be shown. Raises NotServed.

        `comes_within_s`: where it takes longer to reach the session, it is not carried out; None: `deadline_s`.
        """

    def watch(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(kind)` whenever something new is there; answers how to end that."""

    def watch_events(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(name)` whenever pages may have new events of a vehicle, or of any for `ALL`; the caller is
        no viewer. Answers how to end that."""

    def want(self, vehicle: str, kind: str, change: int) -> None:
        """Add (+1) or remove (−1) a viewer of a frame kind that is built only while it is viewed; of `ALL`, a viewer of
        summaries also where one vehicle is known."""
