"""Writes each step of an order to the event log, and whether the car does what the order commands."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from typing_extensions import Unpack

from monitor.check import Verdict
from monitor.checks.slow_down import STANDS_ALREADY, STANDS_UNPROVEN, SlowDownLimits, is_followed, proof_of
from monitor.shell_facts import SlowingFacts
from monitor.state import Snapshot
from server.protocol import serialize
from server.protocol.alarm_state import EventDetails, Note
from server.slowdown.command_target import CommandTarget
from server.slowdown.order import Order, SlowDown, Stands

log = logging.getLogger("catgraph.slowing")


def never_raising(note: Note) -> Note:
    """Log without raising: the slow-down continues if the log fails."""

    def note_safely(change: str, text: str, *, by: str | None = None, **more: Unpack[EventDetails]) -> None:
        try:
            note(change, text, by=by, **more)
        except Exception:
            log.exception("event not logged: %s", text)

    return note_safely


def recording_safely(record: Callable[[Any], None]) -> Callable[[Any], None]:
    """Record without raising: the slow-down continues if recording fails. Failures are logged once until a success."""
    failed = False

    def record_safely(message: Any) -> None:
        nonlocal failed
        try:
            record(message)
            failed = False
        except Exception:
            if not failed:
                failed = True
                log.exception("commands to the car are not recorded")

    return record_safely


class OrderLog:
    """`target`: where commands go now."""

    def __init__(self, note: Note, target: Callable[[], CommandTarget]) -> None:
        self._note = note
        self._target = target

    def write(self, order: Order, step: str, text: str, *, by: str | None = None) -> None:
        """An event with what was commanded last; `by`: who ordered this step."""
        last = order.last
        self._note(
            "slow_down",
            text,
            by=by,
            step=step,
            order=order.number,
            why=order.why,
            ordered_by=order.by,
            commanded_mps=serialize.plain(last.speed_mps, 2) if last else None,
            topic=self._target().topic,
            stands=order.stands,
            tyre_rad=serialize.plain(last.tyre_rad, 4) if last else None,
        )


def commanded(order: Order) -> str:
    """The newest command as text."""
    last = order.last
    return "nothing yet" if last is None else f"{last.speed_mps:.2f} m/s, tyres at {last.tyre_rad:+.3f} rad"


class Response:
    """The car's response to the active order."""

    def __init__(self, life: SlowDown, order_log: OrderLog) -> None:
        self._life = life
        self._order_log = order_log
        self.is_missing = False  # the car was found not to slow

    def begin(self) -> None:
        """Start for a new order."""
        self.is_missing = False

    def judge(
        self, order: Order, snapshot: Snapshot, facts: SlowingFacts, limits: SlowDownLimits, *, now_s: float
    ) -> None:
        """With each tick of the session."""
        snapshot = replace(snapshot, slowing=facts)
        found = is_followed(snapshot, limits, self.is_missing).verdict
        proof = proof_of(snapshot)
        if found is Verdict.OK:
            self.is_missing = False
            if proof.shown is None:
                self._stands(order, stood_before=proof.stood_before)
            elif order.first_sent_s is not None and self._life.confirm(now_s):
                after = f"{now_s - order.first_sent_s:.1f} s after the first command"
                what = "slows" if proof.shown == "slows" else "stopped"
                self._order_log.write(order, "slows", f"The car {what}: shown by its own speed {after}.")
        elif found is Verdict.FAULT and not self.is_missing:
            self.is_missing = True
            text = "NOT CONFIRMED: the car does not slow. Use the physical stop."
            self._order_log.write(order, "not_confirmed", text)
        if found is not Verdict.OK:
            order.stands = None

    def _stands(self, order: Order, *, stood_before: bool) -> None:
        """The car stands without proof that the order stopped it: report standstill only."""
        stands: Stands = "before" if stood_before else "unproven"
        if order.stands != stands:
            order.stands = stands
            self._order_log.write(order, "stands", f"{STANDS_ALREADY if stood_before else STANDS_UNPROVEN}.")
