"""One-shot tickets for the socket: issued to an authenticated request, used up by the next socket.

A browser opens sockets from any page to any server and sends the cookies; only a page of this server can read a
ticket. Time is an argument.
"""

from __future__ import annotations

import hmac
import secrets
from collections import OrderedDict

LASTS_S = 5.0
MOST = 2000


class Tickets:
    """Those not used yet."""

    def __init__(self) -> None:
        self._open: OrderedDict[str, tuple[str, float]] = OrderedDict()  # ticket → whose, until when [s]

    def new(self, whose: str, *, now_s: float) -> str:
        """A ticket for the device or program `whose`."""
        self._drop(now_s)
        ticket = secrets.token_urlsafe(18)
        self._open[ticket] = (whose, now_s + LASTS_S)
        while len(self._open) > MOST:
            self._open.popitem(last=False)
        return ticket

    def use(self, ticket: str, whose: str, *, now_s: float) -> bool:
        """Whether `whose` may open a socket with it. It is used up by being shown, right or not."""
        self._drop(now_s)
        owner, _ = self._open.pop(ticket, ("", 0.0))
        return bool(owner) and hmac.compare_digest(owner.encode(), whose.encode())

    def _drop(self, now_s: float) -> None:
        while self._open and next(iter(self._open.values()))[1] <= now_s:
            self._open.popitem(last=False)
