"""The one place from which anything is published to a car."""

from __future__ import annotations

from typing import Any

from server.rosbridge.live_source import CommandChannel, LinkDown
from server.rosbridge.outgoing import NotAllowed

ADVERTISE_ID = "catgraph:slow-down"


class CommandPublisher:
    """Advertises once an opening, publishes now or not at all, and remembers nothing for later."""

    def __init__(self) -> None:
        self._link: CommandChannel | None = None
        self._advertised: dict[str, str] = {}  # topic → type, on this opening

    def attach(self, link: CommandChannel | None) -> None:
        """Another opening, or none: what was advertised on the last one is gone with it."""
        self._link = link
        self._advertised.clear()

    def advertise(self, topic: str, type: str) -> None:
        """Announces a topic, so that the first message finds those who listen. Raises LinkDown."""
        if self._advertised.get(topic) != type:
            self._link_now().send_now(
                {"op": "advertise", "id": f"{ADVERTISE_ID}:{topic}", "topic": topic, "type": type}
            )
            self._advertised[topic] = type

    def unadvertise_all(self) -> None:
        """Withdraw all announced topics."""
        for topic in list(self._advertised):
            del self._advertised[topic]
            try:
                self._link_now().send_now({"op": "unadvertise", "id": f"{ADVERTISE_ID}:{topic}", "topic": topic})
            except LinkDown:
                return
            except NotAllowed:
                continue  # the other topics still end

    def publish(self, topic: str, type: str, message: dict[str, Any]) -> None:
        """One message, written now. Raises LinkDown."""
        self.advertise(topic, type)
        self._link_now().send_now({"op": "publish", "topic": topic, "msg": message})

    def _link_now(self) -> CommandChannel:
        if self._link is None or not self._link.is_open:
            raise LinkDown("not sent: no connection to the car")
        return self._link
