"""What one page was offered, and how many states it gets without an offer.

Over a slow radio a frame per round trip is too few, and a lost packet that nothing follows is repeated late. A page
that measures such a radio states with each *take* how many states have come, and how many may be under way: a window,
so that nothing waits behind more than these, however little the radio carries.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from server.protocol.messages import FrameKind

OFFER_EVERY_S = 0.05  # least time between two offers to one page: as often as a scan comes
AHEAD_EVERY_S = 0.15  # least time between two states that are sent ahead
FIRST_AHEAD = 3  # so many states come before the first take: a page uncovers its values after as many
THIN_AHEAD = 2  # a page that allows no more has a radio that carries little
THIN_SCAN_EVERY_S = 3.0  # scans of the live car over such a radio: it may be a route that has only become longer
MOST_AHEAD = 12  # to a page that does not answer: its answers may wait 1.8 s for one that was lost
ECHO_EVERY_S = 0.5  # so often a take is answered at once: by it the page measures the radio and bounds the clock


def _count(value: object) -> int:
    return value if type(value) is int and 0 < value < 1 << 53 else 0


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
        self._offered_s = self._echoed_s = float("-inf")
        self._open_seq = 0  # of the newest offer of anything
        self._ahead = FIRST_AHEAD  # so many states may be under way; 0: the page takes them one by one
        self._ahead_s = float("-inf")
        self._scan_s = float("-inf")
        self._sent = 0  # states of this connection
        self._received = 0  # of these, as the page stated
        self._sent_s: deque[float] = deque(maxlen=2 * MOST_AHEAD)  # when the last of them were
        self.trip_s = 0.0  # the least from a state to the answer; 0: none is known

    def taken(self, take: Mapping[str, object]) -> bool:
        """The page takes; whether it took what was offered. One of a former page, without a number, always does."""
        self.took_ms = self._wall_ms()
        self.took = _count(take.get("n"))
        self._ahead = min(_count(take.get("ahead")), MOST_AHEAD)
        self._receive(min(_count(take.get("got")), self._sent))
        self.is_echo_due = self.is_echo_due or (self._ahead > 0 and self._now() >= self._echoed_s + ECHO_EVERY_S)
        if self.took and not (self.is_open and take.get("seq") == self._open_seq):
            return False
        self.is_open = False
        return True

    def _receive(self, count: int) -> None:
        if count <= self._received:
            return
        self._received = count
        later = self._sent - count
        if later < len(self._sent_s):
            trip_s = self._now() - self._sent_s[-1 - later]
            self.trip_s = min(self.trip_s or trip_s, trip_s)

    @property
    def carries_scan(self) -> bool:
        """Whether a scan may be sent: over a radio that carries little, seldom."""
        is_thin = 0 < self._ahead <= THIN_AHEAD
        return not is_thin or self._now() >= self._scan_s + THIN_SCAN_EVERY_S

    @property
    def has_room(self) -> bool:
        """Whether one more state may be under way."""
        return not self._ahead or self._sent - self._received < self._ahead

    @property
    def may_push(self) -> bool:
        """Whether a state may be sent ahead, now or soon."""
        return self._ahead > 0 and self.has_room

    def push_wait_s(self) -> float:
        """How long the next state that is sent ahead has to wait."""
        every_s = OFFER_EVERY_S if self._sent < FIRST_AHEAD else AHEAD_EVERY_S
        return self._ahead_s + every_s - self._now()

    def sent(self, kind: FrameKind) -> None:
        """A frame was sent."""
        if kind == "state":
            self._ahead_s = self._now()
            self._sent += 1
            self._sent_s.append(self._ahead_s)
        elif kind == "scan":
            self._scan_s = self._now()

    def offer_wait_s(self) -> float:
        """How long the next offer has to wait."""
        return self._offered_s + OFFER_EVERY_S - self._now()

    def offered(self, *, is_echo: bool) -> int:
        """An offer is sent now, of nothing where it is an echo; its number."""
        self.seq += 1
        if is_echo:
            self.is_echo_due = False
            self._echoed_s = self._now()
        else:
            self.is_open = True
            self._open_seq = self.seq
            self._offered_s = self._now()
        return self.seq
