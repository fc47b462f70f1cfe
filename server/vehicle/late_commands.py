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


def order_of(message: Mapping[str, Any]) -> str | None:
    """The kind of an order; None: a query, what a page sends again by itself, or no command at all."""
    kind = message.get("kind")
    command = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
    return None if command is None or command.signature != "required" else str(kind)


class LateCommands:
    """Of one agent. `find(vehicle)`: what writes into the log of a car; None: it is not monitored."""

    def __init__(self, find: Callable[[str], Note | None], *, now: Callable[[], float]) -> None:
        self._find = find
        self._now = now
        self._allowances: dict[tuple[str, bool], Allowance] = {}

    def note(self, vehicle: str, command: Mapping[str, Any], why: str) -> None:
        """Log an order that a web node passed on, in the name that the node states; what floods the log is left out."""
        now_s, kind = self._now(), order_of(command)
        if kind is None or (note := self._find(vehicle)) is None:
            return
        # A flood of others leaves room for a slow-down that was refused.
        allowance = self._allowances.setdefault((vehicle, kind == "slow_down"), Allowance(OF_NODES, now_s))
        if allowance.takes(now_s):
            by = display_name.clean(command.get("by"))
            log_late(note, kind, why, by=display_name.not_signed(by) if by else None)
