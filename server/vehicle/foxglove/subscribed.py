"""What is wanted of a Foxglove server, topic by topic, and under which numbers it is subscribed to."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable

from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.protocol import Channel


class Subscribed:
    """Over all openings; the table is kept. `send(frame)` sends now; `sent(topic, number)` goes before each."""

    def __init__(self, send: Callable[[bytes], None], sent: Callable[[str, int], None]) -> None:
        self._send = send
        self._sent = sent
        self._ids = itertools.count(1)  # never one again: what comes late belongs to its own subscription
        self.table: dict[str, Subscription] = {}
        self.channels: dict[int, Channel] = {}  # number of the subscription → its channel

    def closed(self) -> None:
        self.channels.clear()

    def begin(self, topic: str, channels: Collection[Channel]) -> list[int]:
        """Subscribes to these channels of a topic, as far as that is not done, and to no other one of it. The numbers
        that are free now."""
        ended = self._end(number for number, one in self.channels.items() if one.topic == topic and one not in channels)
        known = set(self.channels.values())
        new = {next(self._ids): channel for channel in channels if channel not in known}
        self.channels.update(new)
        for number in new:
            self._sent(topic, number)
        if new:
            self._send(protocol.subscribe((number, channel.id) for number, channel in new.items()))
        return ended

    def end(self, topic: str) -> list[int]:
        """The numbers that are free of their topic now."""
        return self.begin(topic, ())

    def _end(self, numbers: Iterable[int]) -> list[int]:
        ended = list(numbers)
        for number in ended:
            del self.channels[number]
        if ended:
            self._send(protocol.unsubscribe(ended))
        return ended

    def gone(self, channel: Channel) -> list[int]:
        """A channel is not offered any more, and with it its subscriptions ended: their numbers."""
        ended = [number for number, one in self.channels.items() if one.id == channel.id]
        for number in ended:
            del self.channels[number]
        return ended
