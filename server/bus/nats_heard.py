"""Which agents a web node has heard, and what to say of those that it does not hear."""

from __future__ import annotations

from collections.abc import Callable, Collection

from server.bus.bus import NotServed
from server.bus.nats_questions import Questions

SILENT_AFTER_S = 1.5  # an agent says every second that it is there: pages cover their values after 2 s, and state why
GONE_AFTER_S = 3.0  # an agent that has not been heard for so long is not asked


class Heard:
    """`now`: a monotonic clock in seconds; `expected`: vehicles that belong here before they are heard."""

    def __init__(self, questions: Questions, *, now: Callable[[], float], expected: Collection[str] = ()) -> None:
        self._questions = questions
        self._now = now
        self._expected = frozenset(expected)
        self._heard_s: dict[str, float] = {}
        self._newest_s = 0.0  # of any agent

    @property
    def vehicles(self) -> tuple[str, ...]:
        """All that were ever heard or are expected: one whose agent is gone is shown as lost, not left out."""
        return tuple(sorted(self._expected | self._heard_s.keys()))

    def note(self, vehicle: str) -> None:
        """Its agent said something just now."""
        self._heard_s[vehicle] = self._newest_s = self._now()

    def trouble(self, vehicle: str) -> str | None:
        """As `PageBus.trouble`."""
        client = self._questions.client
        if client is None or not client.is_connected:
            return "The broker between the server and the car does not answer."
        if vehicle not in self._heard_s:
            return f"The agent of {vehicle} has sent nothing since the server started."
        if self._is_heard(vehicle):
            return None
        if self._now() - max(self._newest_s, self._questions.heard_s) <= SILENT_AFTER_S:
            return f"The agent of {vehicle} does not answer."
        return f"Nothing comes from the agent of {vehicle}: it or the broker does not answer."

    def check_known(self, vehicle: str) -> None:
        """Raises NotServed where the agent was never heard."""
        if vehicle not in self._heard_s:
            is_expected = vehicle in self._expected
            raise NotServed(
                f"nothing was received from {vehicle} yet" if is_expected else f"no vehicle is named {vehicle}"
            )

    def check(self, vehicle: str) -> None:
        """Raises NotServed where it makes no sense to ask the agent."""
        self.check_known(vehicle)
        heard_s = self._heard_s[vehicle]
        if self._now() - heard_s > GONE_AFTER_S:
            why = f"nothing came from the agent of {vehicle} for {self._now() - heard_s:.0f} s"
            raise NotServed(why, cut="broker-agent")

    def _is_heard(self, vehicle: str) -> bool:
        clock = self._questions.clocks.get(vehicle)
        heard_s = max(self._heard_s[vehicle], clock.heard_s if clock is not None else 0.0)
        return self._now() - heard_s <= SILENT_AFTER_S
