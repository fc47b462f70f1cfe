"""Growing waits after wrong PINs, per peer and for the whole server. Time is an argument.

A PIN has a million values and is valid for ten minutes. All peers together get MANY tries at once and then one in
LONGEST_ALL_S: some 30 in the life of a PIN, so that it is guessed once in thirty thousand lives. The address of a peer
grants nothing: it only makes a guesser wait earlier than others.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

FEW = 3  # wrong tries of one peer before it waits
MANY = 10  # wrong tries of all together before all wait
LONGEST_ONE_S = 300.0
LONGEST_ALL_S = 30.0
FORGIVEN_AFTER_S = 900.0  # without another wrong try
MOST_PEERS = 1000


@dataclass(slots=True)
class _Tries:
    wrong: int = 0
    until_s: float = 0.0
    last_s: float = 0.0


class PinThrottle:
    """Counts wrong tries. A try is admitted and checked without an await between, so that parallel tries all count."""

    def __init__(self) -> None:
        self._all = _Tries()
        self._peers: OrderedDict[str, _Tries] = OrderedDict()

    def wait_s(self, peer: str, *, now_s: float) -> float:
        """How long `peer` must wait before its next try is looked at; 0: it may try."""
        mine = self._peers.get(peer)
        until_s = max(self._all.until_s, mine.until_s if mine is not None else 0.0)
        return max(0.0, until_s - now_s)

    def wrong(self, peer: str, *, now_s: float) -> None:
        """A try was wrong."""
        mine = self._peers.setdefault(peer, _Tries())
        self._peers.move_to_end(peer)
        while len(self._peers) > MOST_PEERS:
            self._peers.popitem(last=False)
        for tries, free, longest_s in ((mine, FEW, LONGEST_ONE_S), (self._all, MANY, LONGEST_ALL_S)):
            if now_s - tries.last_s > FORGIVEN_AFTER_S:
                tries.wrong = 0
            tries.wrong += 1
            tries.last_s = now_s
            if tries.wrong >= free:
                tries.until_s = now_s + min(longest_s, 2.0 ** min(tries.wrong - free + 1, 16))

    def right(self, peer: str) -> None:
        """The peer was let in: its own wrong tries are forgotten, those of the others are not."""
        self._peers.pop(peer, None)
