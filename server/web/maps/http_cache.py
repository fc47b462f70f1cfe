"""HTTP caching and rate limits of a tile server: lifetimes, retries, request limits. Pure: times are arguments.

HTTP caching is RFC 9111, Retry-After RFC 9110 10.2.3. Without headers tiles are valid for seven days.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from email.utils import parsedate_to_datetime

DEFAULT_FRESH_S = 7 * 86_400.0  # without headers: the least that OpenStreetMap's tile policy requires
LONGEST_S = 365 * 86_400.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 5.0, 300.0  # after a failure; each doubles the one before
PAUSE_BOUNDS_S = (1.0, 86_400.0)  # the bounds of a Retry-After
MOST, WITHIN_S = 1200, 600.0  # tiles: two a second on end is what driving with the map open needs at most


def fresh_for_s(headers: Mapping[str, str], wall_s: float) -> float | None:
    """How long an answer holds from now [s]; None: it must not be kept."""
    fields = {name.lower(): value for name, value in headers.items()}
    directives: dict[str, str] = {}
    for part in fields.get("cache-control", "").lower().split(","):
        name, _, value = part.strip().partition("=")
        directives.setdefault(name, value.strip('" '))
    if "no-store" in directives:
        return None
    if "no-cache" in directives:
        return 0.0
    for name in ("s-maxage", "max-age"):  # several phones are served from what is kept
        if name in directives:
            return _bounded((_number(directives[name]) or 0.0) - (_number(fields.get("age", "")) or 0.0))
    if "expires" in fields:
        expires_s, date_s = _date_s(fields["expires"]), _date_s(fields.get("date", ""))
        return 0.0 if expires_s is None else _bounded(expires_s - (wall_s if date_s is None else date_s))
    return DEFAULT_FRESH_S


def retry_after_s(value: str | None, wall_s: float) -> float | None:
    """The requested pause [s], bounded; None: none."""
    if not value:
        return None
    pause_s = _number(value)
    if pause_s is None:
        at_s = _date_s(value)
        pause_s = None if at_s is None else at_s - wall_s
    return None if pause_s is None else min(max(pause_s, PAUSE_BOUNDS_S[0]), PAUSE_BOUNDS_S[1])


class Pace:
    """When the next tile may be requested. Times are monotonic [s]."""

    def __init__(self) -> None:
        self.problem: str | None = None  # what went wrong last; None once it is over
        self._until_s = 0.0
        self._pause_s = FIRST_PAUSE_S
        self._requested_s: deque[float] = deque(maxlen=MOST)

    def may_ask(self, now_s: float) -> bool:
        return now_s >= self._until_s and not self._is_spent(now_s)

    def note_request(self, now_s: float) -> None:
        self._requested_s.append(now_s)

    def well(self) -> None:
        """It answered as it should."""
        self.problem = None
        self._pause_s = FIRST_PAUSE_S

    def failed(self, why: str, now_s: float, wanted_s: float | None = None) -> None:
        """Record a failure; `wanted_s` is the requested pause. Two concurrent failures count once."""
        is_new = now_s >= self._until_s
        self.problem = why
        self._until_s = max(self._until_s, now_s + (self._pause_s if wanted_s is None else wanted_s))
        if is_new:
            self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)

    def problem_now(self, now_s: float) -> str | None:
        """Why no request is allowed now, as one sentence for the operator."""
        if self.problem is not None:
            return self.problem
        if self._is_spent(now_s):
            return f"{MOST} tiles were fetched within {WITHIN_S / 60:.0f} min: more come later."
        return None

    def _is_spent(self, now_s: float) -> bool:
        return len(self._requested_s) == MOST and now_s - self._requested_s[0] < WITHIN_S


def _bounded(seconds: float) -> float:
    return min(max(seconds, 0.0), LONGEST_S)


def _number(text: str) -> float | None:
    return float(text) if re.fullmatch(r"[0-9]{1,12}", text.strip()) else None


def _date_s(text: str) -> float | None:
    try:
        return parsedate_to_datetime(text).timestamp()
    except (ValueError, TypeError, OverflowError, IndexError):
        return None
