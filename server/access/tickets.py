"""One-shot tickets for the socket: issued to an authenticated request or socket, used up by the next socket.

A browser opens sockets from any page to any server and sends the cookies; only a page of this server can read a
ticket. Time is an argument.
"""

from __future__ import annotations

import hmac
import math
import secrets
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LASTS_S = 5.0
AFTER_SOCKET_S = (
    600.0  # after the end of the socket that it was given with: a page that is away for longer requests one
)
MOST = 2000


class Tickets:
    """Those not used yet."""

    def __init__(self) -> None:
        self._open: OrderedDict[str, tuple[str, float]] = OrderedDict()  # ticket → whose, until when [s]

    def new(self, whose: str, *, now_s: float, lasts_s: float = LASTS_S) -> str:
        """A ticket for the device or program `whose`."""
        self._drop(now_s)
        ticket = secrets.token_urlsafe(18)
        self._open[ticket] = (whose, now_s + lasts_s)
        while len(self._open) > MOST:
            self._open.popitem(last=False)
        return ticket

    @contextmanager
    def beside_socket(self, whose: str, *, now: Callable[[], float]) -> Iterator[str]:
        """A ticket for the socket after the one that is served meanwhile."""
        ticket = self.new(whose, now_s=now(), lasts_s=math.inf)
        try:
            yield ticket
        finally:
            if ticket in self._open:
                self._open[ticket] = (whose, now() + AFTER_SOCKET_S)

    def use(self, ticket: str, whose: str, *, now_s: float) -> bool:
        """Whether `whose` may open a socket with it. It is used up by being shown, right or not."""
        self._drop(now_s)
        owner, _ = self._open.pop(ticket, ("", 0.0))
        return bool(owner) and hmac.compare_digest(owner.encode(), whose.encode())

    def _drop(self, now_s: float) -> None:
        for ticket in [one for one, (_, until_s) in self._open.items() if until_s <= now_s]:
            del self._open[ticket]
