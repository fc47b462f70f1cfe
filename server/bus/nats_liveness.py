"""From which agents a web node receives something, and the reasons where it receives nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection

from server.bus.bus import NotServed
from server.bus.nats_questions import Questions

SILENT_AFTER_S = 1.5  # an agent announces itself every second: pages cover their values after 2 s, and state why
GONE_AFTER_S = 3.0  # an agent that was silent for so long gets no requests


class AgentLiveness:
    """`now`: a monotonic clock in seconds; `expected`: vehicles that are listed before their agents send anything."""

    def __init__(self, questions: Questions, *, now: Callable[[], float], expected: Collection[str] = ()) -> None:
        self._questions = questions
        self._now = now
        self._expected = frozenset(expected)
        self._received_s: dict[str, float] = {}
        self._newest_s = 0.0  # of any agent

    @property
    def vehicles(self) -> tuple[str, ...]:
        """All that are expected or whose agents ever sent something; a lost one is listed as lost."""
        return tuple(sorted(self._expected | self._received_s.keys()))

    def note(self, vehicle: str) -> None:
        """Something was received from its agent just now."""
        self._received_s[vehicle] = self._newest_s = self._now()

    def trouble(self, vehicle: str) -> str | None:
        """As `PageBus.trouble`."""
        client = self._questions.client
        if client is None or not client.is_connected:
            return "The broker between the server and the car does not answer."
        if vehicle not in self._received_s:
            return f"The agent of {vehicle} has sent nothing since the server started."
        if self._is_live(vehicle):
            return None
        if self._now() - max(self._newest_s, self._questions.received_s) <= SILENT_AFTER_S:
            return f"The agent of {vehicle} does not answer."
        return f"Nothing comes from the agent of {vehicle}: it or the broker does not answer."

    def is_gone(self, vehicle: str) -> bool:
        """Whether nothing came from it for so long that what it was requested is lost; False: or it was never there."""
        return vehicle in self._received_s and self._silent_s(vehicle) > GONE_AFTER_S

    def check_known(self, vehicle: str) -> None:
        """Raises NotServed where nothing was ever received from the agent."""
        if vehicle not in self._received_s:
            is_expected = vehicle in self._expected
            raise NotServed(
                f"nothing was received from {vehicle} yet" if is_expected else f"no vehicle is named {vehicle}"
            )

    def check(self, vehicle: str) -> None:
        """Raises NotServed where the agent is not known, or has been silent for too long."""
        self.check_known(vehicle)
        received_s = self._received_s[vehicle]
        if self._now() - received_s > GONE_AFTER_S:
            why = f"nothing came from the agent of {vehicle} for {self._now() - received_s:.0f} s"
            raise NotServed(why, cut="broker-agent")

    def _is_live(self, vehicle: str) -> bool:
        return self._silent_s(vehicle) <= SILENT_AFTER_S

    def _silent_s(self, vehicle: str) -> float:
        """Since anything came from it."""
        clock = self._questions.clocks.get(vehicle)
        return self._now() - max(self._received_s[vehicle], clock.received_s if clock is not None else 0.0)
