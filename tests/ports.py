"""TCP ports for what is started on a known port, or ends and is started there again."""

from __future__ import annotations

import random
import socket
from collections import deque

# Below those that Linux takes for a program that binds to port 0: nobody else is given one of them by chance.
FIRST, LAST = 20_000, 30_000
MOST_RESERVED = 300  # of one process; the oldest are of tests that are over

_reserved: deque[socket.socket] = deque()


def free_port(host: str = "127.0.0.1") -> int:
    """A port that nothing listens on now, and that no other process of the tests is given meanwhile.

    The UDP port of the same number is what reserves it, until this process ends or has reserved many more.
    """
    for number in random.sample(range(FIRST, LAST), LAST - FIRST):
        reservation = socket.socket(type=socket.SOCK_DGRAM)
        try:
            reservation.bind((host, number))
            with socket.socket() as probe:
                probe.bind((host, number))
        except OSError:
            reservation.close()
            continue
        _reserved.append(reservation)
        if len(_reserved) > MOST_RESERVED:
            _reserved.popleft().close()
        return number
    raise OSError(f"no port of {FIRST} to {LAST} is free on {host}")
