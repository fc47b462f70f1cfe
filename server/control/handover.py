"""A hand-over of control with read-back: the taker confirms each line before control changes.

The list is made for each state; this module alone decides what has to be confirmed. Pure: time is an
argument, which must not go back.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from monitor.alarm_spec import Priority
from monitor.runner import Refused
from server.control.lease import Lease, Operator
from server.protocol.operator_state import LineKind

LASTS_S = 600.0  # an offer that is not completed ends
AWAY_S = 30.0  # the taker's page may be away so long


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of the list. Another key is another line, which has to be confirmed by itself."""

    key: str
    kind: LineKind
    title: str
    text: str = ""
    priority: Priority | None = None  # of an alarm
    since_ms: int | None = None  # time of day
    until_ms: int | None = None
    off_duty_ms: int | None = None  # of an acknowledged alarm: when the duty of its owner ended


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """Moments are on the clock of the caller."""

    by: Operator
    fence: int
    to: Operator
    since_s: float
    heard_s: float  # the newest sign of the taker's page
    read: frozenset[str] = frozenset()  # keys of lines


class NotReadBack(Refused):
    """The list differs from what was read back."""


def version_of(lines: Sequence[Line]) -> str:
    """Names a list of lines: another one has another version."""
    return hashlib.sha256("\n".join(sorted(line.key for line in lines)).encode()).hexdigest()[:12]


class Handover:
    """At most one of a vehicle. Call `advance` before anything else at a moment."""

    def __init__(self) -> None:
        self.offer: Offer | None = None

    def advance(self, lease: Lease | None, is_here: Callable[[Operator], bool], now_s: float) -> str | None:
        """Time passes; why the offer ended by it, as a sentence."""
        offer = self.offer
        if offer is None:
            return None
        if lease is None or lease.fence != offer.fence:
            self.offer = None
            return f"The hand-over to {offer.to.name} ended: {offer.by.name} is not in control any more."
        if is_here(offer.to):
            self.offer = offer = replace(offer, heard_s=now_s)
        if now_s - offer.heard_s > AWAY_S:
            self.offer = None
            return f"The hand-over ended: the page of {offer.to.name} is away. {offer.by.name} keeps control."
        if now_s - offer.since_s > LASTS_S:
            self.offer = None
            return f"The hand-over was not completed within {LASTS_S / 60:.0f} min: {offer.by.name} keeps control."
        return None

    def begin(self, by: Operator, lease: Lease | None, to: Operator, now_s: float) -> bool:
        """Offer control; an earlier offer is replaced. False: they have the offer already. Raises Refused."""
        if lease is None or not by.is_same(lease.holder):
            raise Refused("Only who is in control can hand it over.")
        if by.is_same(to):
            raise Refused("This page is in control already: hand over to another one.")
        if self.offer is not None and to.is_same(self.offer.to):
            return False
        self.offer = Offer(by=by, fence=lease.fence, to=to, since_s=now_s, heard_s=now_s)
        return True

    def read(self, by: Operator, key: str, is_read: bool, lines: Sequence[Line]) -> None:
        """Confirm a line, or take that back. Raises Refused."""
        offer = self._offer_to(by)
        if key not in {line.key for line in lines}:
            raise NotReadBack("This no longer applies: look at the list again.")
        self.offer = replace(offer, read=offer.read | {key} if is_read else offer.read - {key})

    def unread(self, lines: Sequence[Line]) -> list[Line]:
        """The lines that are not confirmed."""
        read = self.offer.read if self.offer is not None else frozenset()
        return [line for line in lines if line.key not in read]

    def accept(self, by: Operator, version: str, lines: Sequence[Line]) -> Offer:
        """End the offer; the caller then changes control. Raises NotReadBack, Refused."""
        offer = self._offer_to(by)
        left = self.unread(lines)
        if left:
            many = "One line is" if len(left) == 1 else f"{len(left)} lines are"
            raise NotReadBack(f"{many} not read back yet: {left[0].title}.")
        if version != version_of(lines):
            raise NotReadBack("The list has changed meanwhile: look at it again.")
        self.offer = None
        return offer

    def end(self, by: Operator) -> Offer:
        """Decline it, or take it back. Raises Refused."""
        offer = self.offer
        if offer is None or not (by.is_same(offer.to) or by.is_same(offer.by)):
            raise Refused("Control is not being handed over to or by this page.")
        self.offer = None
        return offer

    def _offer_to(self, by: Operator) -> Offer:
        if self.offer is None or not by.is_same(self.offer.to):
            raise Refused("Control is not offered to this page.")
        return self.offer
