"""What is wanted of a Foxglove server, topic by topic, and under which numbers it is subscribed to."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable

from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.protocol import Channel

QUIET_S = 2.0  # without a message for so long, a topic may be subscribed to anew and nothing is missed


class Subscribed:
    """Over all openings; the table is kept. `send(frame)` sends now; `sent(topic, number)` goes before each."""

    def __init__(self, send: Callable[[bytes], None], sent: Callable[[str, int], None]) -> None:
        self._send = send
        self._sent = sent
        self._ids = itertools.count(1)  # never one again: what comes late belongs to its own subscription
        self._came_s: dict[str, float] = {}
        self.table: dict[str, Subscription] = {}
        self.channels: dict[int, Channel] = {}  # number of the subscription → its channel

    def closed(self) -> None:
        self.channels.clear()
        self._came_s.clear()

    def begin(self, channels: Iterable[Channel]) -> None:
        """Subscribes to channels, as far as that is not done."""
        known = set(self.channels.values())
        new = {next(self._ids): channel for channel in channels if channel not in known}
        if not new:
            return
        self.channels.update(new)
        for number, channel in new.items():
            self._sent(channel.topic, number)
        self._send(protocol.subscribe((number, channel.id) for number, channel in new.items()))

    def end(self, topic: str) -> list[int]:
        """The numbers that are free of their topic now."""
        ended = [number for number, channel in self.channels.items() if channel.topic == topic]
        for number in ended:
            del self.channels[number]
        if ended:
            self._send(protocol.unsubscribe(ended))
        return ended

    def gone(self, channel: Channel) -> None:
        """A channel is not offered any more, and with it its subscriptions ended."""
        for number in [number for number, one in self.channels.items() if one.id == channel.id]:
            del self.channels[number]

    def came(self, topic: str, at_s: float) -> None:
        self._came_s[topic] = at_s

    def is_quiet(self, topic: str, now_s: float) -> bool:
        return now_s - self._came_s.get(topic, -QUIET_S) >= QUIET_S
