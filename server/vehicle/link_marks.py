"""What a link measures and subscribes to, passed to the parts that follow it."""

from __future__ import annotations

from collections.abc import Callable

from server.rosbridge.link_listener import Marks


class LinkMarks:
    """The `marks` of one car's link: those of its delay, and every subscription that is sent."""

    def __init__(self, delay: Marks, subscribed: Callable[[str], None]) -> None:
        """`subscribed(topic)` is called with each subscription that is sent, the first one or another."""
        self._delay = delay
        self._subscribed = subscribed

    def open(self, at_s: float) -> None:
        self._delay.open(at_s)

    def took(self, size: int) -> None:
        self._delay.took(size)

    def sent(self, at_s: float) -> None:
        self._delay.sent(at_s)

    def answered(self, sent_s: float, at_s: float) -> None:
        self._delay.answered(sent_s, at_s)

    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None:
        self._delay.subscribe(topic, queue_length, throttle_s)
        self._subscribed(topic)
