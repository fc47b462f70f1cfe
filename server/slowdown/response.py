"""Finds out whether the car does what an order commands, and writes that to the event log."""

from __future__ import annotations

from dataclasses import replace

from monitor.check import Verdict
from monitor.checks.slow_down import STANDS_ALREADY, STANDS_UNPROVEN, SlowDownLimits, obeys, proof_of
from monitor.slowing import SlowingFacts
from monitor.state import Snapshot
from server.slowdown.order import Order, SlowDown, Stands
from server.slowdown.order_log import OrderLog


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
        found = obeys(snapshot, limits, self.is_missing).verdict
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
