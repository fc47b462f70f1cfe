"""Commands that came too late and were not carried out, as the log of their car has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from server.control import display_name
from server.protocol import commands
from server.protocol.alarm_state import Note
from server.protocol.rate_limit import Allowance, Rate

OF_NODES = Rate(per_s=1.0, at_once=30)  # a web node proves nothing of a command that it passes on late


def log_late(note: Note, kind: str, why: str, *, by: str | None) -> None:
    """`why` is a sentence."""
    if kind == "slow_down":
        note("slow_down", f"Slow-down refused: {why}", by=by, step="refused")
    else:
        note("late", f"“{kind}” was not carried out: {why}", by=by)


class LateCommands:
    """Of one agent. `find(vehicle)`: what writes into the log of a car; None: it is not monitored."""

    def __init__(self, find: Callable[[str], Note | None], *, now: Callable[[], float]) -> None:
        self._find = find
        self._now = now
        self._allowances: dict[str, Allowance] = {}

    def note(self, vehicle: str, command: Mapping[str, Any], why: str) -> None:
        """Log an order that a web node passed on, in the name that the node states; what floods the log is left out.

        Queries, and what a page sends again by itself as its status, are no orders.
        """
        now_s, kind = self._now(), command.get("kind")
        order = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
        if order is None or order.signature != "required":
            return
        allowance = self._allowances.setdefault(vehicle, Allowance(OF_NODES, now_s))
        if (note := self._find(vehicle)) is not None and allowance.takes(now_s):
            log_late(note, str(kind), why, by=display_name.clean(command.get("by")) or None)
