"""Gaps of a recording that playing passes over: little of them is shown."""

from __future__ import annotations

from server.judge.offline import OfflineRun

EMPTY_S = 60.0  # a gap without any message that is passed over; a shorter one is played
SHOWN_S, LEAD_S = 10.0, 2.0  # of its beginning and of its end


def behind_gap(run: OfflineRun, length_s: float) -> float | None:
    """Where playing goes on [s since the beginning], in the middle of a gap; None: it is in none."""
    last_s = run.run_state.last_message_s
    is_shown = run.at_s - (0.0 if last_s is None else last_s) >= SHOWN_S
    next_s = min(run.next_s, length_s)
    return next_s - LEAD_S if is_shown and next_s - run.at_s > EMPTY_S - SHOWN_S else None
