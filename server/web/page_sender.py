"""Who a page is: the admitted device, and the name and the id that the page gives itself."""

from __future__ import annotations

import contextlib
import re
import secrets
from collections.abc import Mapping
from typing import Any

from server.access.identity import LOCAL, Principal
from server.access.people import NOBODY, People, device_key
from server.control import display_name
from server.protocol import command_base, signed_order
from server.protocol.people import Duty

ENDING = ("accept_control", "outcome")  # the commands whose answer states that control was handed over
LONGEST_AGO_S = 3600.0


class PageSender:
    """Of one page."""

    def __init__(self, principal: Principal, people: People = NOBODY, *, signs: bool = False) -> None:
        """`people`: who is on duty at which device. `signs`: its orders are signed for an agent, to which it is the key
        that it names."""
        self._principal = principal
        self._people = people
        self._signs = signs
        self._key: str | None = None
        self._name = display_name.NAMELESS  # which the page gave itself: who gave its orders, in the log
        self._page = secrets.token_hex(8)  # by which the page keeps control over a reload
        self.has_begun = False

    @property
    def is_operator(self) -> bool:
        return self._principal.is_operator

    def is_same(self, other: PageSender) -> bool:
        """Whether both are of one page."""
        return self.has_begun and (self._principal.id, self._page) == (other._principal.id, other._page)

    def begin(self, hello: Mapping[str, Any]) -> None:
        """The page's hello: its name, and the id that it keeps over a reload, of which only the first counts."""
        page = hello.get("page")
        if not self.has_begun and isinstance(page, str) and re.fullmatch(command_base.PAGE, page):
            self._page = page
        self._name = display_name.clean(hello.get("name")) or self._name
        self.has_begun = True

    @property
    def device(self) -> str | None:
        """The key under which somebody is on duty at this page's device."""
        return device_key(self._principal, self._page)

    @property
    def device_name(self) -> str:
        return self._name if self._principal is LOCAL else self._principal.name

    @property
    def duty(self) -> Duty:
        """Who is on duty at this page's device, as the page gets it."""
        return self._people.duty_of(self.device, self.device_name)

    async def end_handed_over(self, kind: object, answer: Mapping[str, Any]) -> Mapping[str, Any]:
        """The answer to a command of this kind as the page gets it.

        A hand-over that it completes, or reports late, ends the duty of who handed over, unless it is that of this
        page's own device.
        """
        if not isinstance(over := answer.get("handed_over"), Mapping):
            return answer
        reply = {name: value for name, value in answer.items() if name != "handed_over"}
        device, ago_s = str(over.get("device")), over.get("ago_s")
        if kind not in ENDING or device == self.device:
            return reply
        taker = display_name.clean(over.get("to")) or display_name.NAMELESS
        with contextlib.suppress(OSError):  # it ended all the same
            await self._people.sign_off(
                device,
                f"Control was handed over to {taker}: nobody is on duty here now.",
                ago_s=ago_s if isinstance(ago_s, float) and 0.0 <= ago_s < LONGEST_AGO_S else 0.0,
            )
        return reply

    def note_key(self, message: Mapping[str, Any]) -> None:
        """Take the key by which the page signs from its status, where it signs. The agent verifies it."""
        key = message.get("key")
        if self._signs and isinstance(key, str) and re.fullmatch(signed_order.KEY_ID, key):
            self._key = key

    def as_json(self, *, is_replaying: bool = False) -> dict[str, Any]:
        """Who sends; it replaces whatever the page itself states of that."""
        return {
            "by": self.device_name,
            **self._people.sent(self.device),
            "who": self._key or self._principal.id,
            "page": self._page,
            "replaying": is_replaying,
            "console": False,
        }
