"""What one page was offered, and how many states it gets without an offer.

Over a slow radio a frame per round trip is too few, and a lost packet that nothing follows is repeated late. A page
that measures such a radio states with each *take* how many states may be sent ahead of its next one.
"""

from __future__ import annotations

from collections.abc import Callable

OFFER_EVERY_S = 0.05  # least time between two offers to one page: as often as a scan comes
AHEAD_EVERY_S = 0.15  # least time between two states that are sent ahead
MOST_AHEAD = 12  # to a page that does not answer: its answers may wait 1.8 s for one that was lost
ECHO_EVERY_S = (
    0.5  # so often a take without an offer is answered: the page measures the radio and bounds the clock by it
)


class PageOffers:
    """Of one page. `now` is a monotonic clock [s], `wall_ms` the time of day."""

    def __init__(self, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._now = now
        self._wall_ms = wall_ms
        self.seq = 0
        self.is_open = False  # an offer is unanswered
        self.took_ms = wall_ms()  # when the last take came; before, when the page connected
        self.took = 0  # its number, as the page counts
        self.is_echo_due = False
        self._offered_s = float("-inf")
        self._ahead = 0
        self._ahead_s = float("-inf")

    def taken(self, seq: object, number: object, ahead: object) -> bool:
        """The page takes; whether it took what was offered."""
        self.took_ms = self._wall_ms()
        self.took = number if type(number) is int and 0 < number < 1 << 53 else 0
        self._ahead = min(ahead, MOST_AHEAD) if type(ahead) is int and ahead > 0 else 0
        if self._ahead and seq == 0:
            self.is_echo_due = self.is_echo_due or self._now() >= self._offered_s + ECHO_EVERY_S
            return False
        self.is_open = False
        return True

    @property
    def may_push(self) -> bool:
        """Whether a state may be sent ahead, now or soon."""
        return self._ahead > 0

    def push_wait_s(self) -> float:
        """How long the next state that is sent ahead has to wait."""
        return self._ahead_s + AHEAD_EVERY_S - self._now()

    def sent_state(self, *, is_ahead: bool) -> None:
        self._ahead_s = self._now()
        if is_ahead:
            self._ahead -= 1

    def offer_wait_s(self) -> float:
        """How long the next offer has to wait."""
        return self._offered_s + OFFER_EVERY_S - self._now()

    def offered(self, *, is_echo: bool) -> int:
        """An offer is sent now; its number."""
        self.seq += 1
        self.is_open = self.is_open or not is_echo
        self.is_echo_due = False
        self._offered_s = self._now()
        return self.seq
