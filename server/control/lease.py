"""The control lease: three seconds, with a fencing number. Pure: time is an argument.

The status of a visible page renews its lease. Without it the lease lapses and anybody may take control at once; the
former holder gets it back within 30 s if nobody took it. Each lease has a unique number, and a command with the number
of another lease is refused (after Kleppmann, Designing Data-Intensive Applications, 8.4), so that a command delayed by
the radio cannot take effect after control changed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from monitor.runner import Refused
from server.control.duty import OnDuty

LEASE_S = 3.0  # a visible page reports once a second
RETURN_S = 30.0
ANSWER_S = 10.0  # the holder sees a request so long; silence grants it
MOST_REQUESTS = 8

# taken: it was free · granted: a request, accepted or timed out · kept: a request was refused
Change = Literal["taken", "released", "handed_over", "granted", "taken_over", "lapsed", "returned", "requested",
                 "withdrawn", "kept"]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Operator:
    """One page of one device, which may be in control."""

    page: str  # the page's own name for itself, the same over reconnections and reloads
    who: str  # the device that was let in
    name: str  # as people read it
    person: OnDuty | None = None  # who is on duty there

    def is_same(self, other: Operator | None) -> bool:
        return other is not None and (self.page, self.who) == (other.page, other.who)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lease:
    """Control, as long as it is renewed. Moments are on the clock of the caller."""

    holder: Operator
    fence: int
    since_s: float
    renewed_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A request to the holder for control."""

    of: Operator
    asked_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Lapsed:
    """The last lease lapsed, and none followed."""

    holder: Operator
    at_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Act:
    """What happened to control, for the log and for all pages."""

    change: Change
    text: str
    by: Operator | None  # who did it; None: time did
    holder: Operator | None  # who has control now …
    fence: int | None  # … by this lease
    before: Operator | None = None  # who had it until now, where that is another


class NotInControl(Refused):
    """Somebody else is in control, or the order is of a lease that is over."""

    def __init__(self, reason: str, holder: Operator | None) -> None:
        super().__init__(reason)
        self.holder = holder


class Control:
    """The one lease of a vehicle. Call `advance` before anything else at a moment: it is what lets time pass."""

    def __init__(self, fence: int = 0) -> None:
        """`fence`: the last number that was given, in whatever run of the program."""
        self.lease: Lease | None = None
        self.lapsed: Lapsed | None = None
        self.requests: tuple[Request, ...] = ()  # the oldest first
        self._fence = fence

    @property
    def holder(self) -> Operator | None:
        return None if self.lease is None else self.lease.holder

    # -- time --------------------------------------------------------------------------------------------------------

    def advance(self, now_s: float, is_here: Callable[[Operator], bool]) -> list[Act]:
        """Advance the time: lapse a lease that was not renewed, grant a request that was not answered. `is_here`:
        whether a page is open and visible; requests of other pages are dropped."""
        self.requests = tuple(one for one in self.requests if is_here(one.of))
        if self.lapsed is not None and now_s - self.lapsed.at_s > RETURN_S:
            self.lapsed = None
        lease = self.lease
        if lease is None:
            return []
        acts = []
        if now_s - lease.renewed_s > LEASE_S:
            silent_s = now_s - lease.renewed_s
            acts += self._lapse(f"{lease.holder.name} fell silent for {silent_s:.0f} s", now_s)
        elif self.requests and now_s - self.requests[0].asked_s >= ANSWER_S:
            one = self.requests[0].of
            text = f"{one.name} is in control: {lease.holder.name} did not answer within {ANSWER_S:.0f} s."
            acts.append(self._grant("granted", one, None, now_s, lease.holder, text))
        return acts

    def present(self, operator: Operator, now_s: float) -> Act | None:
        """This page is seen now: its lease is renewed; one that lapsed a moment ago is given to it again."""
        lease = self.lease
        if lease is not None:
            if operator.is_same(lease.holder):
                self.lease = Lease(holder=operator, fence=lease.fence, since_s=lease.since_s, renewed_s=now_s)
            return None
        if self.lapsed is None or not operator.is_same(self.lapsed.holder):
            return None
        away_s = now_s - self.lapsed.at_s + LEASE_S
        text = f"{operator.name} is back after {away_s:.0f} s and in control again: nobody else had taken it."
        return self._grant("returned", operator, None, now_s, None, text)

    def leave(self, operator: Operator, now_s: float) -> list[Act]:
        """End the lease of a page that was closed or reloaded. A reloaded page returns in time to get it back."""
        if not operator.is_same(self.holder):
            return []
        return self._lapse(f"{operator.name} left", now_s)

    # -- what an operator does ---------------------------------------------------------------------------------------

    def admit(self, operator: Operator, fence: int | None) -> None:
        """Authorize a command that needs control. Without a number it is accepted from the holder, and if nobody is in
        control. Raises NotInControl."""
        holder = self.holder
        if holder is not None and not operator.is_same(holder):
            raise NotInControl(f"{holder.name} is in control.", holder)
        self.admit_fence(fence)

    def admit_fence(self, fence: int | None) -> None:
        """Raises NotInControl where an order is of a lease that is over."""
        if fence is not None and (self.lease is None or fence != self.lease.fence):
            raise NotInControl("Control changed since this command: check, then send it again.", self.holder)

    def take(self, operator: Operator, now_s: float) -> Act | None:
        """Take control that is free. None: this page already has it. Raises NotInControl."""
        holder = self.holder
        if holder is None:
            return self._grant("taken", operator, operator, now_s, None, f"{operator.name} is in control.")
        if operator.is_same(holder):
            return None
        raise NotInControl(f"{holder.name} is in control: request control, or take it over.", holder)

    def take_over(self, operator: Operator, now_s: float) -> Act | None:
        """Take control from any holder."""
        holder = self.holder
        if holder is None or operator.is_same(holder):
            return self.take(operator, now_s)
        text = f"{operator.name} took control over from {holder.name}."
        return self._grant("taken_over", operator, operator, now_s, holder, text)

    def request(self, operator: Operator, now_s: float) -> Act | None:
        """Request control from the holder, or take it if it is free. None: already requested."""
        holder = self.holder
        if holder is None or operator.is_same(holder):
            return self.take(operator, now_s)
        if any(operator.is_same(one.of) for one in self.requests):
            return None
        if len(self.requests) >= MOST_REQUESTS:
            raise NotInControl(f"{len(self.requests)} operators are already asking {holder.name}.", holder)
        self.requests = (*self.requests, Request(of=operator, asked_s=now_s))
        return self._act("requested", f"{operator.name} requests control from {holder.name}.", operator)

    def withdraw(self, operator: Operator) -> Act | None:
        """A request is taken back."""
        if not any(operator.is_same(one.of) for one in self.requests):
            return None
        self.requests = tuple(one for one in self.requests if not operator.is_same(one.of))
        return self._act("withdrawn", f"{operator.name} cancelled the request for control.", operator)

    def answer(self, operator: Operator) -> None:
        """A request was answered otherwise than by granting it: silence does not grant it any more."""
        self.requests = tuple(one for one in self.requests if not operator.is_same(one.of))

    def hand_over(self, by: Operator, fence: int | None, to: Operator, now_s: float) -> Act | None:
        """The holder gives control to another page; so it also grants a request. Raises NotInControl."""
        self._demand(by, fence)
        if by.is_same(to):
            return None
        is_asked = any(to.is_same(one.of) for one in self.requests)
        text = f"{by.name} handed control over to {to.name}."
        return self._grant("granted" if is_asked else "handed_over", to, by, now_s, by, text)

    def keep(self, by: Operator, fence: int | None, page: str) -> Act:
        """The holder refuses a request. Raises Refused."""
        self._demand(by, fence)
        one = next((one.of for one in self.requests if one.of.page == page), None)
        if one is None:
            raise Refused("Nobody is requesting control now.")
        self.requests = tuple(other for other in self.requests if not other.of.is_same(one))
        return self._act("kept", f"{by.name} keeps control; the request of {one.name} was declined.", by)

    def release(self, by: Operator, fence: int | None, now_s: float) -> list[Act]:
        """Give up control; the first requester gets it, else nobody. Raises NotInControl."""
        self._demand(by, fence)
        self.lease = self.lapsed = None
        acts = [self._act("released", f"{by.name} gave control up: nobody is in control.", by, by)]
        if self.requests:
            one = self.requests[0].of
            acts.append(self._grant("granted", one, None, now_s, None, f"{one.name}, who requested it, is in control."))
        return acts

    # -- within ------------------------------------------------------------------------------------------------------

    def _lapse(self, why: str, now_s: float) -> list[Act]:
        """End a lease that was not renewed; the first requester gets it, else nobody."""
        assert self.lease is not None
        was = self.lease.holder
        self.lease, self.lapsed = None, Lapsed(holder=was, at_s=now_s)
        acts = [self._act("lapsed", f"{why}: nobody is in control.", None, was)]
        if self.requests:
            one = self.requests[0].of
            text = f"{one.name}, who requested it, is in control."
            acts.append(self._grant("granted", one, None, now_s, None, text))
        return acts

    def _demand(self, by: Operator, fence: int | None) -> None:
        """Only the holder does this."""
        if not by.is_same(self.holder):
            reason = "Nobody is in control." if self.holder is None else f"{self.holder.name} is in control."
            raise NotInControl(reason, self.holder)
        self.admit_fence(fence)

    def _grant(
        self, change: Change, to: Operator, by: Operator | None, now_s: float, before: Operator | None, text: str
    ) -> Act:
        """Start a new lease with its own number; open requests are dropped."""
        self._fence += 1
        self.lease = Lease(holder=to, fence=self._fence, since_s=now_s, renewed_s=now_s)
        self.lapsed, self.requests = None, ()
        return self._act(change, text, by, before)

    def _act(self, change: Change, text: str, by: Operator | None, before: Operator | None = None) -> Act:
        lease = self.lease
        return Act(
            change=change,
            text=text,
            by=by,
            holder=self.holder,
            fence=None if lease is None else lease.fence,
            before=before,
        )
