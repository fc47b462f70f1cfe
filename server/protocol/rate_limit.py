"""How much one page, one device and one address may ask for: generous to people, and an end to what runs away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

MAX_DEPTH = 32  # of what a page sends; its deepest message nests three deep


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """So many a second, and so many at once after a pause."""

    per_s: float
    at_once: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The figures of one server. What a person or a page by itself causes stays ten times below them."""

    body_bytes: int = 256 * 1024  # the largest there is, settings as TOML, has 64 kB
    body_s: float = 20.0  # from a request's head to the end of its body
    upload_bytes: int = 8 * 1024 * 1024  # of a voice note or a photo, which its route bounds further
    upload_s: float = 120.0
    head_bytes: int = 32 * 1024
    head_s: float = 10.0  # from a connection's first byte to the end of a request's head; also for that first byte
    connections: int = 64  # from one address that is not this machine's own
    pages: int = 12  # sockets of one device
    requests: Rate = Rate(per_s=100.0, at_once=600)  # of one device: a map that is dragged requests dozens of tiles
    local_requests: Rate = Rate(per_s=2000.0, at_once=4000)  # of all on this machine, where nobody pairs
    commands: Rate = Rate(
        per_s=40.0, at_once=120
    )  # of one page: a replay that is dragged through requests dozens of moments
    slow_down: Rate = Rate(per_s=5.0, at_once=20)  # of one page or device, apart from all its other requests
    messages: Rate = Rate(per_s=300.0, at_once=900)  # of one page, its answers to frames included


class Allowance:
    """What is left of a rate. `now_s` is any monotonic clock [s]."""

    __slots__ = ("_at_s", "_left", "_rate")

    def __init__(self, rate: Rate, now_s: float) -> None:
        self._rate = rate
        self._left = float(rate.at_once)
        self._at_s = now_s

    def takes(self, now_s: float) -> bool:
        """Takes one where there is one."""
        self._fill(now_s)
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True

    def wait_s(self, now_s: float) -> float:
        """How long until there is one."""
        self._fill(now_s)
        return max(0.0, (1.0 - self._left) / self._rate.per_s)

    def is_whole(self, now_s: float) -> bool:
        """Whether none is in use: it need not be kept."""
        self._fill(now_s)
        return self._left >= self._rate.at_once

    def _fill(self, now_s: float) -> None:
        self._left = min(float(self._rate.at_once), self._left + max(0.0, now_s - self._at_s) * self._rate.per_s)
        self._at_s = max(self._at_s, now_s)


def nests_deeper(value: Any, most: int) -> bool:
    """Whether lists and objects stand in each other more than `most` deep. Never recurses itself."""
    level = [value] if isinstance(value, (dict, list)) else []
    for _ in range(most):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, (dict, list))
        ]
        if not level:
            return False
    return bool(level)
