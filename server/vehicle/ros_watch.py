"""Checks whether ROS behind the bridge is alive, and which other nodes publish commands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from server.rosbridge.diagnosis import Diagnosis
from server.rosbridge.live_source import LiveSource
from server.rosbridge.rosapi_client import Questions
from server.vehicle import discovery

ALIVE_EVERY_S = 1.0
DOUBT_S = 0.5  # after a first failure: is it one?


class RosWatch:
    """Of one car, over any number of openings. `now` is a monotonic clock in seconds.

    `timed(asked_s, ros_s)`: the time of the call and the time of ROS.
    """

    def __init__(
        self, link: LiveSource | None, *, now: Callable[[], float], timed: Callable[[float, float], None]
    ) -> None:
        """`link` None: no car is dialled."""
        self._now = now
        self._timed = timed
        self.diagnosis = Diagnosis()
        self.asks = None if link is None else Questions(link, self.diagnosis, now=now)
        self.alive: bool | None = None  # None: not known
        self.answered_s: float | None = None
        self.commanded_on: str | None = None  # the topic on which the car is commanded
        self.publishers: tuple[str, ...] | None = None  # who publishes there; None: not known

    def watch_commands(self, topic: str | None) -> None:
        """Set the command topic whose publishers are fetched; None: there is none."""
        if topic != self.commanded_on:
            self.commanded_on, self.publishers = topic, None

    async def ask(self, asks: Questions) -> bool | None:
        """Call rosapi; return whether ROS answered. Raises LinkDown."""
        alive = await discovery.fetch_alive(asks, timed=partial(self._timed, self._now()))
        if self.commanded_on is not None:
            self.publishers = await discovery.fetch_publishers(asks, self.commanded_on)
        return alive

    def answered(self, alive: bool | None) -> None:
        """What became of the newest question."""
        if alive:
            self.answered_s = self._now()
        self.alive = alive if self.answered_s is not None else None

    @property
    def pause_s(self) -> float:
        """Until the next question."""
        return DOUBT_S if self.diagnosis.doubts else ALIVE_EVERY_S

    def end(self) -> None:
        """Whatever is still answered is of no interest any more."""
        if self.asks is not None:
            self.asks.stop()
