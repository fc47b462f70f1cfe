"""Which pings of a Foxglove server's link are answered behind its messages: by that, how late the link is.

A server of foxglove-sdk answers a ping at once and keeps up to 1024 messages of all topics in a queue of their own: a
message that comes after the answer may have waited a minute. But the queue is in order, and each message has the time
at which it entered it, on the server's clock. That clock is bounded by the first message of each subscription, which
entered after the subscription was sent, and by each message after a moment in which none waited. So each message shows
that whatever comes from then on is no older.

Where no message comes, an answer alone proves nothing: what is in the queue waits while the radio or a large message
holds the connection up. The next ping proves that the answer before it arrived, and by that the server may write again;
the one after shows that it wrote nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from server.rosbridge.link_listener import Marks

IDLE_S = 0.3  # from the answer to a ping until the next ping that shows whether a message waited
MOST_PINGS = 600
DRIFT = 5e-4  # of two clocks, in the worst case
DRIFT_S = 0.1  # a server's time that leaves this, besides, is no clock


class StreamMarks:
    """Which pings lie behind a message in the stream of one connection.

    Pure: time is an argument, in seconds of our own clock.
    """

    def __init__(self) -> None:
        self._asked_s: dict[int, float] = {}  # subscription of which nothing came → when it was sent
        self._ahead_s: dict[int, float] = {}  # subscription → the most that its times are ahead of our clock
        self._moved_s: dict[int, tuple[float, float]] = {}  # … since when, and how much it was corrected
        self._pongs: deque[tuple[float, float]] = deque(maxlen=MOST_PINGS)  # answered: sent, and when the answer came
        self._busy_s = -float("inf")  # when a message came, or a part of one
        self._proved_s = -float("inf")  # when the newest ping was sent that lies behind

    def subscribed(self, subscription: int, at_s: float) -> None:
        self._asked_s[subscription] = at_s

    def unsubscribed(self, subscription: int) -> None:
        for known in (self._asked_s, self._ahead_s, self._moved_s):
            known.pop(subscription, None)

    def pong(self, sent_s: float, at_s: float, *, is_in_message: bool = False) -> tuple[float, float] | None:
        """The answer to a ping came, `is_in_message`: between two parts of a message. The newest ping that was answered
        while no message waited, as when it was sent and when answered; None: no newer one is known."""
        idle = None if is_in_message else self._idle(sent_s)
        self._pongs.append((sent_s, at_s))
        if is_in_message:
            self._busy_s = at_s
        if idle is not None:
            self._proved_s = max(self._proved_s, idle[0])
            while self._pongs[0] <= idle:
                self._pongs.popleft()
        return idle

    def skipped(self, at_s: float) -> None:
        """A message came that was not read."""
        self._busy_s = at_s

    def message(self, subscription: int, sent_ns: int, at_s: float) -> float | None:
        """A message came: the newest ping that was sent before it entered the server's queue; None: no newer one is
        known to have been."""
        self._busy_s = at_s
        entered_s = self._entered_s(subscription, sent_ns / 1e9, at_s)
        newest_s = None
        while entered_s is not None and self._pongs and self._pongs[0][0] <= entered_s:
            newest_s, _ = self._pongs.popleft()
        self._proved_s = max(self._proved_s, newest_s or self._proved_s)
        return newest_s

    def _idle(self, sent_s: float) -> tuple[float, float] | None:
        """The newest ping whose answer was followed by no message until a second ping, sent so long afterwards, and the
        one sent then were answered."""
        quiet = [one for one in self._pongs if self._busy_s < one[1] < sent_s]
        return next((one for one in reversed(quiet) if one[1] + IDLE_S <= quiet[-1][0]), None)

    def _entered_s(self, subscription: int, sent_s: float, at_s: float) -> float | None:
        """When a message entered the queue at the earliest; None: its time is of no use."""
        asked_s = self._asked_s.pop(subscription, None)
        if asked_s is not None:
            self._ahead_s[subscription], self._moved_s[subscription] = sent_s - asked_s, (at_s, 0.0)
        if subscription not in self._ahead_s:
            return None
        ahead_s = self._ahead_s[subscription] = min(self._ahead_s[subscription], sent_s - self._proved_s)
        future_s = sent_s - ahead_s - at_s
        if future_s > 0.0:  # the clocks drift; a kept sample or a played time is no clock
            since_s, moved_s = self._moved_s[subscription]
            if moved_s + future_s > DRIFT_S + DRIFT * (at_s - since_s):
                del self._ahead_s[subscription]
                return None
            self._ahead_s[subscription], self._moved_s[subscription] = ahead_s + future_s, (since_s, moved_s + future_s)
            return at_s
        return sent_s - ahead_s


class Delay:
    """Reports which pings of a link are answered behind its messages to the part that follows how late the link is.

    Of one link, over all openings. `marks` None: nobody follows.
    """

    def __init__(self, marks: Marks | None, now: Callable[[], float]) -> None:
        self._marks = marks
        self._now = now
        self._stream = StreamMarks()

    @property
    def is_followed(self) -> bool:
        return self._marks is not None

    def opened(self) -> None:
        self._stream = StreamMarks()
        if self._marks is not None:
            self._marks.open(self._now())

    def took(self, size: int) -> None:
        if self._marks is not None:
            self._marks.took(size)

    def subscribed(self, topic: str, number: int) -> None:
        """A subscription is sent under this number."""
        self._stream.subscribed(number, self._now())
        if self._marks is not None:
            self._marks.subscribe(topic, 0)  # what waits in the server stands before the marks

    def ended(self, numbers: Iterable[int]) -> None:
        for number in numbers:
            self._stream.unsubscribed(number)

    def ping_sent(self, at_s: float) -> None:
        if self._marks is not None:
            self._marks.sent(at_s)

    def pong(self, sent_s: float, *, is_in_message: bool) -> None:
        """The answer to a ping that was sent then came, `is_in_message`: between two parts of a message."""
        idle = self._stream.pong(sent_s, self._now(), is_in_message=is_in_message)
        if idle is not None and self._marks is not None:
            self._marks.answered(*idle)

    def message(self, number: int, sent_ns: int) -> None:
        """A message of a subscription came, which the server took at that time of its own clock."""
        sent_s = self._stream.message(number, sent_ns, self._now())
        if sent_s is not None and self._marks is not None:
            self._marks.answered(sent_s, self._now())

    def skipped(self) -> None:
        """A message came that was not read."""
        self._stream.skipped(self._now())
