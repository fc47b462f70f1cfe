"""Reports which pings of a link are answered behind its messages to the part that follows how late the link is."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from server.rosbridge.link_listener import Marks
from server.vehicle.foxglove.stream_marks import StreamMarks


class Delay:
    """Of one link, over all openings. `marks` None: nobody follows."""

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
