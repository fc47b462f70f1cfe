"""The car's own button: each message on its topic is a mark. Pure but for what it reports; time is an argument."""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from monitor.alarm import Refused
from server.judge.topics import plain_type
from server.protocol.rate_limit import Allowance, Rate
from server.system.clean_text import short_text

TOPIC = "/catgraph/mark"
TYPES = ("std_msgs/String", "std_msgs/Empty", "std_msgs/Bool")
BOUNCES_S = 0.3  # the same again within so long is the same press
GIVEN_WITHIN_S = 2.0  # so long after it has read a subscription a bridge begins to give what is latched
BURST_S = 0.3  # and gives all of it within so long
MOST_QUOTED = 100  # characters of the text that a sentence quotes
RATE = Rate(per_s=1.0, at_once=60)
OLDER = " It came just after subscribing: the button may have been pressed before."
AGAIN = " It may be an earlier press again, or a new one with the same text."

Place = Callable[[str, str, str], None]  # id, text, and what is added to the text of the event; raises Refused


def is_button(topic: str, type: str | None) -> bool:
    """Whether a topic that the car offers is its button."""
    return topic == TOPIC and plain_type(type or "") in TYPES


def unfit(type: str | None) -> str | None:
    """Why the car's button does not mark, where its topic is of another type."""
    if not type or plain_type(type) in TYPES:
        return None
    can = f"only {', '.join(TYPES)} can be read"
    return f"{TOPIC} does not mark: it is {type[:100]}, and {can}. It is recorded as any other topic."


@dataclass(frozen=True, slots=True)
class ButtonSubscription:
    """How the button's topic was subscribed to, the last time."""

    at_s: float
    is_renewal: bool = False  # nothing came of it on this connection: what comes now was not given before


class CarMarks:
    """Of one vehicle. `place` makes a mark, `note` logs why one was not made, once in a while; `is_known`: whether the
    button has marked with this text before; `read_s`: when the bridge was known to have read what had been sent."""

    def __init__(
        self,
        place: Place,
        note: Callable[[str], None],
        *,
        is_known: Callable[[str], bool],
        read_s: Callable[[float], float | None],
        now_s: float,
    ) -> None:
        self._place = place
        self._note = note
        self._is_known = is_known
        self._read_s = read_s
        self._allowance = Allowance(RATE, now_s)
        self._heard: tuple[str, float] | None = None  # the newest message, and when it came
        self._is_refusing = False
        self._subscription: ButtonSubscription | None = None  # the subscription of which something came last
        self._burst_until_s = -math.inf  # what comes until then may be latched
        self._is_noted = False  # that something of this burst does not mark

    def receive(self, message: Any, now_s: float, subscription: ButtonSubscription | None) -> bool:
        """A message of the button; whether it is a mark now."""
        data = message.get("data") if isinstance(message, dict) else None
        text = data if isinstance(data, str) else ""
        is_pressed = data is not False
        key = f"{is_pressed} {text}"
        before, self._heard = self._heard, (key, now_s)
        is_bounce = before is not None and before[0] == key and now_s - before[1] < BOUNCES_S
        is_given = self._is_given(subscription, now_s)
        if not is_pressed or is_bounce:
            return False
        if is_given and subscription is not None and not subscription.is_renewal and self._is_known(text):
            self._note_unmarked(text)
            return False
        return self._mark(text, OLDER if is_given else "", now_s)

    def _is_given(self, subscription: ButtonSubscription | None, now_s: float) -> bool:
        """Whether it came in the burst with which a bridge gives what is latched to a new subscription."""
        if subscription != self._subscription:
            self._subscription, self._is_noted = subscription, False
            read_s = None if subscription is None else self._read_s(subscription.at_s)
            is_soon = read_s is None or now_s - read_s < GIVEN_WITHIN_S
            self._burst_until_s = now_s + BURST_S if subscription is not None and is_soon else -math.inf
        return now_s < self._burst_until_s

    def _note_unmarked(self, text: str) -> None:
        if not self._is_noted:
            quoted = short_text(text, MOST_QUOTED).strip()
            named = f' Its text: "{quoted}".' if quoted else ""
            self._note(f"A message on {TOPIC} that came just after subscribing is not marked.{AGAIN}{named}")
        self._is_noted = True

    def _mark(self, text: str, suffix: str, now_s: float) -> bool:
        try:
            if not self._allowance.takes(now_s):
                raise Refused(f"more than one message a second came on {TOPIC}")
            self._place(f"car-{uuid.uuid4().hex[:20]}", text, suffix)
        except Refused as why:
            if not self._is_refusing:
                self._note(f"Marks of the car are not kept: {why.reason.rstrip('.')}.")
            self._is_refusing = True
            return False
        self._is_refusing = False
        return True
