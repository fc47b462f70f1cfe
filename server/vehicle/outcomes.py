"""What became of the commands of late, for pages whose answer was lost on its way."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from server.bus.bus import Handler
from server.protocol.messages import Answer, HandedOver

log = logging.getLogger("catgraph.session")

LONGEST_WAY_S = 3.0  # of a question; `ago_s` was counted when it left the page
KEPT_S = 120.0
MOST = 1000
GIVEN_UP = "Its page had given it up before it came."

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
