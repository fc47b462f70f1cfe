"""How long a mail waits before it is tried again, and when it is given up."""

from __future__ import annotations

_PAUSES_S = (10, 30, 60, 120, 300, 600, 1200, 1800)
LONGEST_S = 3600.0
AGAIN_S = 5.0  # until a failed task is restarted, and a failed disk is tried again
# Three days, though RFC 5321 4.5.4.1 wants four to five from relays that nobody watches: an operator does here. Counted
# in attempts, not by the clock: a computer in a car may only learn the date after a day.
MAX_ATTEMPTS = len(_PAUSES_S) + 72


def pause_s(attempts: int) -> float:
    """The pause after so many attempts that came to nothing (1: the first)."""
    return float(_PAUSES_S[attempts - 1]) if attempts <= len(_PAUSES_S) else LONGEST_S
