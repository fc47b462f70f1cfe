"""What became of recent commands, for pages whose answer was lost on its way; and the log of those that came late."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from server.bus.bus import Handler
from server.control import display_name
from server.protocol import commands
from server.protocol.alarm_state import Note
from server.protocol.messages import Answer, HandedOver
from server.protocol.rate_limit import Allowance, Rate

log = logging.getLogger("catgraph.session")

LONGEST_WAY_S = 3.0  # of a question; `ago_s` was counted when it left the page
KEPT_S = 120.0
MOST = 1000
GIVEN_UP = "Its page had given it up before it came."
OF_NODES = Rate(per_s=1.0, at_once=30)  # a web node proves nothing of a command that it passes on late

Became = Literal["done", "refused", "never", "under_way", "not_known"]


@dataclass(slots=True)
class _Known:
    at_s: float
    became: Became
    reason: str = ""
    handed_over: HandedOver | None = None


class Outcomes:
    """Of one session, each command by its page and id. `now`: a monotonic clock in seconds.

    `given_up` is called with each command that came when its page had given it up, and why it is not carried out.
    """

    def __init__(
        self, now: Callable[[], float], given_up: Callable[[Mapping[str, Any], str], None] = lambda *_: None
    ) -> None:
        self._now = now
        self._given_up = given_up
        self._since_s = now()  # every command that came since then is known
        self._known: dict[tuple[str, str], _Known] = {}

    async def keep(self, message: Mapping[str, Any], carry_out: Handler) -> Mapping[str, Any]:
        """Has a command carried out, and remembers what became of it."""
        if message.get("kind") in ("present", "outcome"):
            return await carry_out(message)
        if not self.may_begin(message, self._now()):
            self._given_up(message, GIVEN_UP)
            return {"ok": False, "reason": GIVEN_UP}
        try:
            answer = await carry_out(message)
        except BaseException:
            self.interrupt(message, self._now())
            raise
        self.end(message, answer, self._now())
        if message.get("kind") != "position":
            fields = (message.get("kind"), message.get("by"), answer.get("ok"), answer.get("reason", ""))
            log.info("command kind=%s by=%s ok=%s reason=%s", *fields)
        return answer

    def may_begin(self, message: Mapping[str, Any], now_s: float) -> bool:
        """Whether a command that came may be carried out: not one that its page has given up."""
        if (key := _key(message)) is None:
            return True
        if (known := self._known.get(key)) is not None and known.became == "never":
            return False
        self._put(key, _Known(now_s, "under_way"), now_s)
        return True

    def end(self, message: Mapping[str, Any], answer: Mapping[str, Any], now_s: float) -> None:
        """It was carried out or refused."""
        if (key := _key(message)) is not None:
            is_done = answer.get("ok") is True
            known = _Known(now_s, "done" if is_done else "refused", str(answer.get("reason") or ""))
            if is_done and (over := answer.get("handed_over")) is not None:
                known.handed_over = {"device": over["device"], "to": over["to"]}
            self._put(key, known, now_s)

    def interrupt(self, message: Mapping[str, Any], now_s: float) -> None:
        """It took too long, and was left where it was."""
        if (key := _key(message)) is not None:
            self._put(key, _Known(now_s, "not_known"), now_s)

    def ask(self, page: str | None, of: str, ago_s: float, now_s: float) -> Answer:
        """What became of one that was requested `ago_s` ago. One that is not known is not carried out from now on."""
        if page is None:
            return {"ok": True, "became": "not_known"}
        known = self._known.get((page, of))
        if known is None and now_s - ago_s - LONGEST_WAY_S <= self._since_s:
            return {"ok": True, "became": "not_known"}
        if known is None:
            known = _Known(now_s, "never")
            self._put((page, of), known, now_s)
        answer: Answer = {"ok": True, "became": known.became}
        if known.reason:
            answer["reason"] = known.reason
        if known.handed_over is not None:  # the web node may not have received it
            answer["handed_over"] = {**known.handed_over, "ago_s": max(0.0, now_s - known.at_s)}
        return answer

    def _put(self, key: tuple[str, str], known: _Known, now_s: float) -> None:
        self._known.pop(key, None)
        self._known[key] = known
        for old, one in tuple(self._known.items()):
            if now_s - one.at_s <= KEPT_S and len(self._known) <= MOST:
                break
            del self._known[old]
            self._since_s = max(self._since_s, one.at_s)


def _key(message: Mapping[str, Any]) -> tuple[str, str] | None:
    page, id = message.get("page"), message.get("id")
    return (page, id) if isinstance(page, str) and isinstance(id, str) and message.get("kind") != "position" else None


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
