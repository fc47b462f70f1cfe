"""The item of one car in the attention queue: begun by its alarms, assigned by commands, and logged."""

from __future__ import annotations

from collections.abc import Iterable
from typing import assert_never

import orjson

from monitor.alarm import Alarm, AlarmState
from monitor.alarm_spec import Priority
from monitor.runner import Refused
from server.control.attention import Attention, ItemAct, Need
from server.control.authorization import Authorization, Caller
from server.control.lease import Operator
from server.protocol import handover_commands
from server.protocol.alarm_state import Note
from server.protocol.cars_state import AttentionItem, ItemHolder, ItemOffer, PagePerson
from server.vehicle.judgement import Judgement

MOST_PEOPLE = 20
PEOPLE_BYTES = 1500  # of a summary, whose length is bounded


class CarAttention:
    """Of one vehicle; its session is the only writer. Times are on the session's monotonic clock, in seconds."""

    def __init__(self, judgement: Judgement, authorization: Authorization, note: Note) -> None:
        self._judgement = judgement
        self._authorization = authorization
        self._note = note
        self._attention = Attention(lambda: judgement.monitor.limits.attention)

    def tick(self, now_s: float) -> bool:
        """Time passes, or alarms changed; whether the assignment changed by it."""
        supervisors = self._authorization.supervisors(now_s)
        acts = self._attention.advance(need_of(self._judgement.monitor.standing()), now_s, supervisors)
        for act in acts:
            self._log_act(act)
        return bool(acts)

    def mark_present(self, caller: Caller, now_s: float) -> None:
        """A page of this car, or one that announces its alarms, is there."""
        if caller.page is not None:
            self._attention.mark_present(_operator(caller), now_s)

    def execute(self, command: handover_commands.ItemCommand, caller: Caller, now_s: float) -> None:
        """Raises Refused."""
        self.tick(now_s)
        by, attention = _operator(caller), self._attention
        match command:
            case handover_commands.TakeItem():
                act = attention.take(by, now_s, over=command.over)
            case handover_commands.ReleaseItem():
                act = attention.release(by)
            case handover_commands.OfferItem():
                act = attention.offer(by, self._person(command.to, now_s), now_s)
            case handover_commands.AnswerItem():
                act = attention.answer(by, now_s, accept=command.accept)
            case handover_commands.WithdrawItem():
                act = attention.withdraw(by)
            case _:
                assert_never(command)
        if act is not None:
            self._log_act(act)
        self.tick(now_s)  # the timer of what is unassigned again begins now

    def _person(self, page: str, now_s: float) -> Operator:
        """Raises Refused."""
        found = next((one for one in self._authorization.people(now_s) if one.page == page), None)
        if found is None:
            raise Refused("That page is closed or not visible.")
        return found

    def as_json(self, now_s: float, wall_ms: int) -> AttentionItem | None:
        """The item of a summary; None: the car needs nobody."""

        def at_ms(moment_s: float) -> int:
            return round(wall_ms + (moment_s - now_s) * 1000)

        attention = self._attention
        item = attention.item
        if item is None:
            return None
        assigned: ItemHolder | None = None
        if (had := item.assigned) is not None:
            assigned = {"name": had.of.name, "page": had.of.page, "since_ms": at_ms(had.since_s)}
        offered: ItemOffer | None = None
        if (offer := item.offered) is not None:
            offered = {
                "by": offer.by.name,
                "name": offer.to.name,
                "page": offer.to.page,
                "since_ms": at_ms(offer.since_s),
            }
        escalates_s = attention.escalates_s
        return {
            "since_ms": at_ms(item.since_s),
            "assigned": assigned,
            "offered": offered,
            "escalates_ms": None if escalates_s is None else at_ms(escalates_s),
            "escalated_ms": None if item.escalated_s is None else at_ms(item.escalated_s),
            "supervisors": None if (names := self._authorization.supervisors(now_s)) is None else list(names),
        }

    def people(self, now_s: float) -> list[PagePerson]:
        """To whom the item can be handed over: as many as a summary has room for."""
        found: list[PagePerson] = []
        left = PEOPLE_BYTES
        for one in self._authorization.people(now_s)[:MOST_PEOPLE]:
            person: PagePerson = {"page": one.page, "name": one.name}
            left -= len(orjson.dumps(person)) + 1
            if left < 0:
                break
            found.append(person)
        return found

    def _log_act(self, act: ItemAct) -> None:
        self._note(
            "attention",
            act.text,
            by=act.by.name if act.by else None,
            act=act.change,
            by_page=act.by.page if act.by else None,
            holder=act.holder.name if act.holder else None,
            page=act.holder.page if act.holder else None,
            before=act.before.name if act.before else None,
            before_page=act.before.page if act.before else None,
        )


def need_of(standing: Iterable[Alarm]) -> Need | None:
    """Why a car needs a person: its alarms that are active or not acknowledged, without advisories and shelved ones.

    `standing`: the most urgent first.
    """
    asking = [
        alarm
        for alarm in standing
        if alarm.spec.priority is not Priority.ADVISORY and alarm.state is not AlarmState.SHELVED
    ]
    if not asking:
        return None
    critical = next((alarm for alarm in asking if alarm.spec.priority is Priority.CRITICAL), None)
    return Need(title=(critical or asking[0]).spec.title, is_critical=critical is not None)


def _operator(caller: Caller) -> Operator:
    """Who sends. A program has no page: it is known by its name, and keeps an item while it takes it again."""
    if caller.operator is not None:
        return caller.operator
    return Operator(page="", who=f"{caller.who} {caller.name}", name=caller.name, person=caller.person)
