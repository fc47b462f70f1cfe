"""The assignment of a car that needs a person: at most one page has its item in the attention queue.

The item begins when the car needs a person and ends when it no longer does; its assignment ends with it. Pure:
time is an argument, which must not go back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from monitor.instruments import AttentionLimits
from monitor.runner import Refused
from server.control.lease import Operator

Change = Literal[
    "taken", "taken_over", "released", "offered", "accepted", "declined", "withdrawn", "unassigned", "escalated"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """Why a car needs a person: its worst alarm."""

    title: str
    is_critical: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    of: Operator
    since_s: float
    heard_s: float  # the newest sign of the page


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """The holder offers the item to `to`."""

    by: Operator
    to: Operator
    since_s: float
    heard_s: float  # the newest sign of the page to which it is offered


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """Moments are on the clock of the caller."""

    since_s: float
    assigned: Holder | None = None
    offered: Offer | None = None
    critical_s: float | None = None  # unassigned and critical without a break since then; None: it is not
    escalated_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemAct:
    """What happened to the item, for the log and for all pages."""

    change: Change
    text: str
    by: Operator | None  # who did it; None: time did
    holder: Operator | None  # to whom it is assigned now
    before: Operator | None = None  # to whom it was assigned until now, where that is another


class Attention:
    """The item of one vehicle. Call `advance` before anything else at a moment: it is what lets time pass."""

    def __init__(self, limits: Callable[[], AttentionLimits]) -> None:
        """`limits` that are in force now."""
        self._limits = limits
        self.item: Item | None = None  # None: the car needs nobody

    @property
    def holder(self) -> Operator | None:
        item = self.item
        return None if item is None or item.assigned is None else item.assigned.of

    @property
    def escalates_s(self) -> float | None:
        """When it will be escalated; None: no timer runs."""
        item = self.item
        if item is None or item.critical_s is None or item.escalated_s is not None:
            return None
        return item.critical_s + self._limits().escalates_s

    # -- time --------------------------------------------------------------------------------------------------------

    def advance(self, need: Need | None, now_s: float, supervisors: Sequence[str] | None = None) -> list[ItemAct]:
        """Advance the time: begin or end the item, free it from a silent page, escalate it to the `supervisors` on
        duty; None: who is, is not known."""
        if need is None:
            self.item = None
            return []
        if self.item is None:
            self.item = Item(since_s=now_s)
        acts = [act for act in (self._unassign_silent(now_s), self._end_silent_offer(now_s)) if act is not None]
        self._watch_timer(need, now_s)
        due_s = self.escalates_s
        if due_s is not None and now_s >= due_s:
            self.item = replace(self.item, escalated_s=now_s)
            after_s = self._limits().escalates_s
            text = f"Nobody took “{need.title}” within {after_s:.0f} s: {escalated_to(supervisors)}."
            acts.append(self._act("escalated", text, None))
        return acts

    def _watch_timer(self, need: Need, now_s: float) -> None:
        """The timer runs while the item is unassigned and critical."""
        item = self._expect()
        if item.assigned is not None or not need.is_critical:
            self.item = replace(item, critical_s=None)
        elif item.critical_s is None:
            self.item = replace(item, critical_s=now_s)

    def _unassign_silent(self, now_s: float) -> ItemAct | None:
        item = self._expect()
        had = item.assigned
        if had is None or now_s - had.heard_s <= self._limits().unheard_s:
            return None
        self.item = replace(item, assigned=None, offered=None)
        text = f"The page of {had.of.name} is silent for {now_s - had.heard_s:.0f} s: unassigned again."
        return self._act("unassigned", text, None, had.of)

    def _end_silent_offer(self, now_s: float) -> ItemAct | None:
        item = self._expect()
        offer = item.offered
        if offer is None or now_s - offer.heard_s <= self._limits().unheard_s:
            return None
        self.item = replace(item, offered=None)
        text = f"The page of {offer.to.name} is silent: the offer of {offer.by.name} has ended."
        return self._act("withdrawn", text, None)

    def mark_present(self, operator: Operator, now_s: float) -> None:
        """Record that this page is open now."""
        item = self.item
        if item is None:
            return
        if (had := item.assigned) is not None and operator.is_same(had.of):
            self.item = item = replace(item, assigned=replace(had, of=operator, heard_s=now_s))
        if (offer := item.offered) is not None and operator.is_same(offer.to):
            self.item = replace(item, offered=replace(offer, to=operator, heard_s=now_s))

    # -- what an operator does ---------------------------------------------------------------------------------------

    def take(self, by: Operator, now_s: float, *, over: bool = False) -> ItemAct | None:
        """Assign it to `by`. None: it is already. Raises Refused: it needs nobody, or has somebody."""
        item, had = self._expect(), self.holder
        if by.is_same(had):
            self.mark_present(by, now_s)
            return None
        if item.offered is not None and by.is_same(item.offered.to):
            return self.answer(by, now_s, accept=True)
        if had is not None and not over:
            raise Refused(f"This car is assigned to {had.name}: take it over, or ask.")
        self._assign(by, now_s)
        if had is None:
            return self._act("taken", f"Assigned to {by.name}.", by)
        return self._act("taken_over", f"Assigned to {by.name}, who took it over from {had.name}.", by, had)

    def release(self, by: Operator) -> ItemAct:
        """Give it back to the queue. Raises Refused."""
        item = self._demand(by)
        self.item = replace(item, assigned=None, offered=None)
        return self._act("released", f"{by.name} gave it back: unassigned.", by, by)

    def offer(self, by: Operator, to: Operator, now_s: float) -> ItemAct | None:
        """Offer it to another; an earlier offer is replaced. None: they have the offer. Raises Refused."""
        item = self._demand(by)
        if by.is_same(to):
            raise Refused("This car is assigned to you: ask another person.")
        if item.offered is not None and to.is_same(item.offered.to):
            return None
        self.item = replace(item, offered=Offer(by=by, to=to, since_s=now_s, heard_s=now_s))
        return self._act("offered", f"{by.name} offered it to {to.name}.", by)

    def answer(self, by: Operator, now_s: float, *, accept: bool) -> ItemAct:
        """Accept or decline an offer. Raises Refused."""
        item = self._expect()
        offer = item.offered
        if offer is None or not by.is_same(offer.to):
            raise Refused("You have no offer to take over.")
        if accept:
            self._assign(by, now_s)
            return self._act("accepted", f"Assigned to {by.name}: {offer.by.name} had offered it.", by, offer.by)
        self.item = replace(item, offered=None)
        return self._act("declined", f"{by.name} declined: still assigned to {offer.by.name}.", by)

    def withdraw(self, by: Operator) -> ItemAct | None:
        """Take an offer back. None: there is none. Raises Refused."""
        item = self._demand(by)
        offer = item.offered
        if offer is None:
            return None
        self.item = replace(item, offered=None)
        return self._act("withdrawn", f"{by.name} withdrew the offer to {offer.to.name}.", by)

    # -- within ------------------------------------------------------------------------------------------------------

    def _expect(self) -> Item:
        """Raises Refused where the car needs nobody."""
        if self.item is None:
            raise Refused("This car needs nobody now.")
        return self.item

    def _demand(self, by: Operator) -> Item:
        """Only who has it does this. Raises Refused."""
        item, had = self._expect(), self.holder
        if had is None:
            raise Refused("This car is unassigned.")
        if not by.is_same(had):
            raise Refused(f"This car is assigned to {had.name}.")
        return item

    def _assign(self, to: Operator, now_s: float) -> None:
        """The timer stops; an offer ends."""
        self.item = replace(
            self._expect(),
            assigned=Holder(of=to, since_s=now_s, heard_s=now_s),
            offered=None,
            critical_s=None,
            escalated_s=None,
        )

    def _act(self, change: Change, text: str, by: Operator | None, before: Operator | None = None) -> ItemAct:
        return ItemAct(change=change, text=text, by=by, holder=self.holder, before=before)


def escalated_to(supervisors: Sequence[str] | None) -> str:
    """To whom an item is escalated, as the end of a sentence."""
    if supervisors is None:
        return "escalated to the supervisor"
    if not supervisors:
        return "escalated, but no supervisor is on duty"
    return f"escalated to {' and '.join(supervisors)}, supervisor{'s' if len(supervisors) > 1 else ''}"
