"""Topics whose messages are too large to be read: left after the second one, and named. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from server.rosbridge.websocket import MAX_MESSAGE_BYTES

LARGE_TRIES = 2  # messages that are too large, before the topic is left


class LargeTopics:
    """Of one car."""

    def __init__(self) -> None:
        self._sizes: dict[str, list[int]] = {}  # topic → sizes of its messages that were too large

    def skipped(self, topic: str, size: int) -> bool:
        """A message of `size` bytes was too large; whether its topic is to be left now: it would take the car's
        network for nothing."""
        if topic in self.left:
            return False
        sizes = self._sizes.setdefault(topic, [])
        sizes.append(size)
        return len(sizes) >= LARGE_TRIES

    @property
    def left(self) -> Mapping[str, int]:
        """Topic → bytes of its largest message, of those that are not subscribed to because of it."""
        return {topic: max(sizes) for topic, sizes in self._sizes.items() if len(sizes) >= LARGE_TRIES}

    def sentence(self, topic: str) -> str:
        """The log text for a topic that was unsubscribed."""
        return (
            f"{topic} is no longer received: its messages have {max(self._sizes[topic]) / 2**20:.0f} MB, and "
            f"{MAX_MESSAGE_BYTES // 2**20} MB is the limit."
        )
