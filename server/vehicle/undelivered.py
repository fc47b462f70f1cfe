"""Published topics that a bridge does not deliver, and the cause, by rosapi's list of subscribers.

A topics_glob prevents the bridge from subscribing. Another client's subscription can take the messages: then the
bridge is subscribed, and we get none. A bridge of ROS 2 whose subscription does not fit a publisher that came back
gives one message to each new subscription, until all its clients have left. The bridge reports none of it.

Pure: time is an argument.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from server.rosbridge import connection_errors
from server.rosbridge.connection_errors import Problem

CLIENT_COUNT = "/client_count"  # each rosbridge publishes there how many clients it has
OWN_CLIENTS = 2  # the link and the connection for questions
AGAIN_S = 5.0
BLOCKED_AFTER_S = 4.0  # a publisher may begin a little later
AT_ONCE = 8


@dataclass(slots=True)
class Passing:
    """Of one connection to a bridge."""

    bridges: frozenset[str] = frozenset()  # nodes that are rosbridges; none: not known
    clients: int | None = None  # others that are connected to the bridge
    _since_s: dict[str, float] = field(default_factory=dict)  # silent topics with a publisher
    _asked_s: dict[str, float] = field(default_factory=dict)
    _is_subscribed: dict[str, bool] = field(default_factory=dict)  # by the bridge
    _freed: set[str] = field(default_factory=set)  # silent topics that another client may have stopped blocking
    _freed_s: dict[str, float] = field(default_factory=dict)  # when such a topic was last renewed
    _once: frozenset[str] = frozenset()  # of the silent topics, those of which each subscription gives one message

    def opened(self) -> None:
        """Another connection: another bridge may answer it."""
        self.bridges, self.clients = frozenset(), None
        self._since_s.clear()
        self._asked_s.clear()
        self._is_subscribed.clear()
        self._freed.clear()
        self._freed_s.clear()
        self._once = frozenset()

    def follow(self, silent: Collection[str], now_s: float, *, once: Collection[str] = ()) -> None:
        """Judged topics with a publisher of which nothing came yet, on this connection; `once`: of which one message
        came with each subscription."""
        self._once = frozenset(once)
        silent = self._once.union(silent)
        for known in (self._since_s, self._asked_s, self._is_subscribed, self._freed_s):
            for topic in [topic for topic in known if topic not in silent]:
                del known[topic]
        self._freed &= silent
        for topic in silent:
            self._since_s.setdefault(topic, now_s)

    def to_ask(self, now_s: float) -> list[str]:
        """Topics whose subscribers to fetch now; none while the bridge's node is unknown."""
        if not self.bridges:
            return []
        due = [topic for topic in self._since_s if now_s - self._asked_s.get(topic, -math.inf) >= AGAIN_S]
        return sorted(due, key=lambda topic: self._asked_s.get(topic, -math.inf))[:AT_ONCE]

    def answered(self, topic: str, subscribers: tuple[str, ...] | None, now_s: float) -> None:
        """The nodes that subscribe to a topic; None: unknown."""
        self._asked_s[topic] = now_s
        before = self._is_subscribed.pop(topic, None)
        if subscribers is None:
            return
        is_subscribed = not self.bridges.isdisjoint(subscribers)
        if before and not is_subscribed:  # the client that blocked it left, and ROS 1 forgot our subscription with it
            self._freed.add(topic)
        else:
            self._is_subscribed[topic] = is_subscribed

    def to_renew(self, now_s: float, renewed_s: Callable[[str], float] = lambda _: -math.inf) -> list[str]:
        """Returns, once, the topics that may arrive after a new subscription, because a client left them.

        `renewed_s(topic)`: when it was renewed for another reason.
        """
        newest_s = {one: max(self._freed_s.get(one, -math.inf), renewed_s(one)) for one in self._freed}
        freed = sorted(one for one, at_s in newest_s.items() if now_s - at_s >= AGAIN_S)
        self._freed -= set(freed)
        self._freed_s.update(dict.fromkeys(freed, now_s))
        self._asked_s.update(dict.fromkeys(freed, now_s))  # the bridge needs a moment to subscribe
        return freed

    @property
    def needs_clients(self) -> bool:
        """Whether it matters how many clients the bridge has."""
        return bool(self._since_s)

    def counted(self, message: Any) -> None:
        """A message of CLIENT_COUNT."""
        count = message.get("data") if isinstance(message, dict) else None
        before = self.clients
        self.clients = max(0, count - OWN_CLIENTS) if type(count) is int and 0 <= count < 10_000 else None
        if before is not None and self.clients is not None and self.clients < before:
            self._freed |= set(self._since_s)

    def problem(self, now_s: float) -> Problem | None:
        """What keeps the topics from us; None: nothing is known to."""
        hidden = sorted(topic for topic, is_subscribed in self._is_subscribed.items() if not is_subscribed)
        hidden = [topic for topic in hidden if topic not in self._once]
        if hidden:
            return connection_errors.hidden_topics(hidden)
        if self._once and self.clients:
            return connection_errors.single_messages(sorted(self._once), self.clients)
        blocked = sorted(
            topic
            for topic, since_s in self._since_s.items()
            if topic not in self._once and self._is_subscribed.get(topic) and now_s - since_s >= BLOCKED_AFTER_S
        )
        if blocked and self.clients:
            return connection_errors.blocked_topics(blocked, self.clients)
        return None
