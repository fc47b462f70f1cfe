"""The runs of the server that wrote a log, and where somebody reads on who read it in another run.

Numbers are of a run: a restored, copied or shortened log continues under a run of its own, so that no number of a run
is ever given twice. The log keeps where each run began, so that two logs are known to be the same up to a number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

SENT_ANEW = 500  # events of earlier runs, to a reader with a run that is not in the log: as many as a page keeps


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumed:
    """Where a reader continues."""

    common: int  # up to this number the log is what was read
    after: int  # the events after this number are to be read
    new_after: int  # the events after this number are new to the reader; those before may be known from another log


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """`before`: the newest number of each vehicle when the run began."""

    id: str
    before: Mapping[str, int] = field(default_factory=dict)


class LogRuns:
    """Of one log: its earlier runs, oldest first, and the present one."""

    def __init__(self, earlier: Sequence[Run], present: Run) -> None:
        self.present = present
        self._last: dict[str, Mapping[str, int]] = {}  # the newest number of each vehicle that the log has of a run
        after = present.before
        for run in reversed(earlier):
            self._last[run.id] = after
            # A log that was cut later is shorter than it was when that run began.
            after = {vehicle: min(n, after.get(vehicle, 0)) for vehicle, n in run.before.items()}

    def resume(self, vehicle: str, run: str, n: int, last: int) -> Resumed:
        """For who has read up to `n` in `run`, while the newest event is `last`."""
        if run == self.present.id:
            return _at(min(n, last))
        if run in self._last:
            return _at(min(n, self._last[run].get(vehicle, 0)))
        began = self.present.before.get(vehicle, 0)
        return Resumed(common=0, after=max(0, min(began, last - SENT_ANEW)), new_after=began)


def _at(n: int) -> Resumed:
    return Resumed(common=n, after=n, new_after=n)
