"""Authorizes all commands to a vehicle, from pages and programs.

It holds the control lease and the status of the pages, and logs changes of both.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from monitor.runner import Refused
from monitor.shell_facts import ReachFacts
from server.control import display_name
from server.control.alarm_reach import AlarmReach, Present
from server.control.duty import OnDuty, person_name, role_of
from server.control.lease import ANSWER_S, LEASE_S, RETURN_S, Act, Control, Lease, NotInControl, Operator
from server.protocol import commands, serialize
from server.protocol.alarm_state import Note
from server.protocol.operator_state import OperatorsState

MAX_FENCE = 2**53
MOST_SUPERVISORS = 3  # who are named
KNOWN_S = 10.0  # the pages state every second who is on duty as supervisor
MOST_DUTIES = 400  # names of people that are known to be off duty, former names among them
MOST_NOTED = 64  # pages of which is known who is on duty there


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """The sender of a command, as the server determined it; only the lease number comes from the page."""

    name: str
    who: str = ""
    page: str | None = None  # None: a program, or a page's request over HTTP
    fence: int | None = None
    is_console: bool = False  # a request over HTTP to a server that only this machine reaches: its own console
    is_replaying: bool = False
    device: str = display_name.NAMELESS
    person: OnDuty | None = None  # who is on duty at the device that sends
    supervisors: tuple[str, ...] | None = None  # who is on duty as such, anywhere; None: not known
    duties: Mapping[Any, Any] | None = None  # name → when their duty ended, None: on duty; not checked so far
    listed: int | None = None  # how many are in the list of people; None: not known

    @classmethod
    def of(cls, message: Mapping[str, Any]) -> Caller:
        page, fence = message.get("page"), message.get("fence")
        device = display_name.clean(message.get("by")) or display_name.NAMELESS
        person, duties, listed = on_duty(message.get("person")), message.get("duties"), message.get("listed")
        return cls(
            name=device if person is None else display_name.with_person(person.name, device),
            device=device,
            person=person,
            supervisors=_supervisors(message.get("supervisors")),
            duties=duties if isinstance(duties, Mapping) else None,
            listed=listed if type(listed) is int else None,
            who=str(message.get("who") or ""),
            page=page if isinstance(page, str) else None,
            fence=fence if type(fence) is int and 0 <= fence <= MAX_FENCE else None,
            is_console=message.get("console") is True,
            is_replaying=message.get("replaying") is True,
        )

    @property
    def operator(self) -> Operator | None:
        """The page that may be in control; None: no page sent this."""
        if self.page is None:
            return None
        return Operator(page=self.page, who=self.who, name=self.name, person=self.person)


def _supervisors(found: object) -> tuple[str, ...] | None:
    if not isinstance(found, list):
        return None
    names = (display_name.clean(one) for one in found[:MOST_SUPERVISORS])
    return tuple(name for name in names if name is not None)


def on_duty(found: object) -> OnDuty | None:
    """The person in a message of a web node; None: nobody, or none that can be read."""
    if not isinstance(found, Mapping):
        return None
    with contextlib.suppress(Refused):
        device = found.get("device")
        device = device[:60] if isinstance(device, str) else ""
        return OnDuty(name=person_name(found.get("name")), role=role_of(found.get("role")), device=device)
    return None


class Authorization:
    """Time is an argument; it must not go back."""

    def __init__(self, note: Note, *, fence: int) -> None:
        """`fence`: no number up to this one is ever given: numbers do not come twice, restarts included."""
        self._note = note
        self._control = Control(fence)
        self._reach = AlarmReach()
        self._on_duty: dict[tuple[str, str], OnDuty | None] = {}  # by page, as logged last
        self._supervisors: tuple[tuple[str, ...], float] | None = None  # and when it was stated
        self._duties: Mapping[Any, Any] = {}  # as stated last
        self._listed: int | None = None  # people, as stated last
        self._off_ms: dict[str, int] = {}  # by name, when their duty ended; who was removed since stays
        self.owners: frozenset[str] = frozenset()  # names of people who have acknowledged what stands now

    def tick(self, now_s: float) -> bool:
        """Time passes; whether control changed by it."""
        acts = self._control.advance(now_s, lambda one: self._reach.is_here(one, now_s))
        for act in acts:
            self._log_act(act)
        return bool(acts)

    def admit(self, command: commands.Command, caller: Caller, now_s: float) -> None:
        """Authorize a command or raise NotInControl. If nobody is in control, a command that needs it takes control
        for a visible page, as the tap on Connect does."""
        if command.needs != "control":
            return
        operator, control = caller.operator, self._control
        if operator is not None:
            self._reach.note_command(operator, now_s)
        self.tick(now_s)
        if operator is not None:
            control.admit(operator, caller.fence)
            if control.holder is None and self._reach.is_here(operator, now_s):
                self._log_act(control.take(operator, now_s))
            return
        if caller.is_console:
            return
        control.admit_fence(caller.fence)
        lease = control.lease
        if lease is not None and not (caller.fence == lease.fence and caller.who == lease.holder.who):
            raise NotInControl(f"{lease.holder.name} is in control.", lease.holder)

    def execute(self, command: commands.TakeControl, caller: Caller, now_s: float) -> int | None:
        """Take, hand over or request control; return the lease number if this page holds it. Raises Refused."""
        by, control, fence = caller.operator, self._control, caller.fence
        if by is None:
            raise Refused("Only a page can be in control: a program cannot show that somebody is watching.")
        self._reach.note_command(by, now_s)
        self.tick(now_s)
        if command.do in ("take", "take_over", "request") and not self._reach.is_here(by, now_s):
            raise Refused("Only a visible page can be in control: this one is in the background.")
        acts: list[Act | None] = []
        match command.do:
            case "take":
                acts = [control.take(by, now_s)]
            case "take_over":
                acts = [control.take_over(by, now_s)]
            case "request":
                acts = [control.request(by, now_s)]
            case "withdraw":
                acts = [control.withdraw(by)]
            case "release":
                acts = [*control.release(by, fence, now_s)]
            case "hand_over":
                to = self.find(command.to or "", now_s)
                if to is None:
                    raise Refused("That page is closed or not visible.")
                acts = [control.hand_over(by, fence, to, now_s)]
            case "keep":
                acts = [control.keep(by, fence, command.to or "")]
        for act in acts:
            self._log_act(act)
        return self.fence_of(caller)

    def update_status(self, status: commands.PresentWord, caller: Caller, now_s: float) -> bool:
        """Store a page's status; return whether control changed."""
        operator = caller.operator
        if operator is None:
            return False
        self._note_duty(operator, caller, now_s)
        if status.leaves:
            self._reach.leave(operator)
            given_up = self._control.leave(operator, now_s)
            for released in given_up:
                self._log_act(released)
            return bool(given_up)
        self._reach.update_status(operator, _present(status, caller), now_s)
        changed = self.tick(now_s)
        if status.visible:
            act = self._control.present(operator, now_s)
            self._log_act(act)
            changed = changed or act is not None
        return changed

    def update_status_elsewhere(self, status: commands.PresentWord, caller: Caller, now_s: float) -> None:
        """Store the status of a page that shows another car: it may sound alarms, and has no part in control."""
        if (operator := caller.operator) is None:
            return
        self._take_duties(caller, now_s)
        if status.leaves:
            self._reach.leave_elsewhere(operator)
        else:
            self._reach.update_status_elsewhere(operator, _present(status, caller), now_s)

    def _take_duties(self, caller: Caller, now_s: float) -> None:
        if caller.supervisors is not None:
            self._supervisors = caller.supervisors, now_s
        if caller.listed is not None:
            self._listed = caller.listed
        if caller.duties is None or caller.duties == self._duties:
            return
        self._duties = caller.duties
        for stated, off_ms in list(caller.duties.items())[:MOST_DUTIES]:
            name = display_name.clean(stated) or ""
            self._off_ms.pop(name, None)
            if type(off_ms) is int:
                self._off_ms[name] = off_ms
        newest = set(list(self._off_ms)[-MOST_DUTIES:])
        self._off_ms = {name: at_ms for name, at_ms in self._off_ms.items() if name in newest | self.owners}

    def restore_off_duty(self, owners: Mapping[str, int]) -> None:
        """Of who acted under these names before this run, their duty ended then; what a page states counts more."""
        for signed, off_ms in owners.items():
            name = display_name.person_of(signed)
            if name and name not in self._duties:
                self._off_ms[name] = off_ms

    def off_duty_ms(self, signed: str | None) -> int | None:
        """When the duty of who acted under this name ended; None: on duty, or not known (not a person)."""
        return self._off_ms.get(display_name.person_of(signed) or "") if signed else None

    @property
    def has_people(self) -> bool:
        """Whether anybody is on duty or was lately, and somebody can sign on, as last stated."""
        return bool(self._duties) and self._listed != 0

    def supervisors(self, now_s: float) -> tuple[str, ...] | None:
        """Who is on duty as supervisor; None: no page states it now."""
        stated = self._supervisors
        return None if stated is None or now_s - stated[1] > KNOWN_S else stated[0]

    def _note_duty(self, operator: Operator, caller: Caller, now_s: float) -> None:
        """Log who comes on duty, and who leaves, at a page of this car."""
        self._take_duties(caller, now_s)
        key, now = (operator.who, operator.page), caller.person
        before = self._on_duty.pop(key, None)
        self._on_duty = dict([*self._on_duty.items(), (key, now)][-MOST_NOTED:])
        if before is not None and before != now:
            text = f"{before.name}, {before.title}, is not on duty at {caller.device} any more."
            self._note("duty", text, act="off", person=before.name, role=before.role)
        if now is not None and before != now:
            text = f"{now.name} is on duty as {now.title} at {caller.device}."
            self._note("duty", text, by=caller.name, act="on", person=now.name, role=now.role)

    @property
    def lease(self) -> Lease | None:
        """Who is in control, and since when."""
        return self._control.lease

    def is_here(self, operator: Operator, now_s: float) -> bool:
        """Whether this page is open and visible."""
        return self._reach.is_here(operator, now_s)

    def find(self, page: str, now_s: float) -> Operator | None:
        """The operator of a page that is open and visible."""
        return self._reach.find(page, now_s)

    def answer(self, operator: Operator) -> None:
        """The request of this page is answered by an offer."""
        self._control.answer(operator)

    def hand_over(self, by: Operator, fence: int, to: Operator, now_s: float) -> None:
        """Give control to another page, by a lease that is still the one. Raises NotInControl."""
        self._log_act(self._control.hand_over(by, fence, to, now_s))

    def fence_of(self, caller: Caller) -> int | None:
        """The number of the lease that this page has; None: it has none."""
        lease, operator = self._control.lease, caller.operator
        return lease.fence if lease is not None and operator is not None and operator.is_same(lease.holder) else None

    def heard_s(self) -> float | None:
        """The time of the newest status of an operator's page; None: no page."""
        return self._reach.heard_s()

    def people(self, now_s: float) -> list[Operator]:
        """Whose page is seen, here or on a page that announces this car's alarms."""
        return self._reach.people(now_s)

    def facts(self, now_s: float) -> ReachFacts:
        return self._reach.facts(now_s)

    def as_json(self, now_s: float, wall_ms: float) -> OperatorsState:
        """The `control` and the `reach` of a state."""
        control = self._control
        lease, lapsed = control.lease, control.lapsed
        return {
            "control": {
                "holder": lease.holder.name if lease else None,
                "page": lease.holder.page if lease else None,
                "fence": lease.fence if lease else None,
                "since_ms": round(wall_ms - (now_s - lease.since_s) * 1000) if lease else None,
                "renewed_s": serialize.plain(max(0.0, now_s - lease.renewed_s), 1) if lease else None,
                "lapses_s": LEASE_S,
                "former": None
                if lapsed is None
                else {
                    "name": lapsed.holder.name,
                    "page": lapsed.holder.page,
                    "may_return_s": round(max(0.0, RETURN_S - (now_s - lapsed.at_s)), 1),
                },
                "requests": [
                    {
                        "page": one.of.page,
                        "name": one.of.name,
                        "left_s": round(max(0.0, ANSWER_S - (now_s - one.asked_s)), 1),
                    }
                    for one in control.requests
                ],
            },
            "reach": self._reach.as_json(now_s),
        }

    def _log_act(self, act: Act | None) -> None:
        if act is not None:
            self._note(
                "control",
                act.text,
                by=act.by.name if act.by else None,
                act=act.change,
                by_page=act.by.page if act.by else None,
                holder=act.holder.name if act.holder else None,
                page=act.holder.page if act.holder else None,
                before=act.before.name if act.before else None,
                before_page=act.before.page if act.before else None,
                fence=act.fence,
            )


def _present(status: commands.PresentWord, caller: Caller) -> Present:
    return Present(
        is_visible=status.visible,
        sound=status.sound,
        awake=status.awake,
        vibrates=status.vibrates,
        battery=status.battery,
        is_charging=status.charging,
        lag_s=status.lag_s,
        is_drawing=status.draws,
        is_replaying=caller.is_replaying,
    )
