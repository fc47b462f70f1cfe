"""What is wrong behind the open connection to a bridge: from how rosapi's answers end, and what comes besides.

Pure: time is an argument, in seconds of the session's monotonic clock. Real bridges report their own failures nowhere
but in the text of a failed service call, so that text is the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from server.rosbridge import connection_errors
from server.rosbridge.connection_errors import Problem

SILENT_S = 2.5  # questions without any answer for so long: one of them may be lost on the way
FAILURES = 3  # in a row, for a reason that is not known: a passing one is over by then

Cause = Literal["missing", "no_master", "no_node", "killed"]

# Parts of the text of a failed call, in the order in which they are searched.
TEXTS: tuple[tuple[str, Cause], ...] = (
    ("context is invalid", "no_node"),  # ROS 2: the bridge's node was shut down, its process continues
    ("context is not valid", "no_node"),
    ("communicate with master", "no_master"),  # ROS 1: roscore does not answer
    ("communicate with service", "killed"),  # ROS 1: rosapi was killed, and is still registered
    ("does not exist", "missing"),
)


def cause_of(text: str) -> Cause | None:
    """The cause that the text of a failed call to rosapi shows; None: an unknown one."""
    return next((cause for part, cause in TEXTS if part in text), None)


@dataclass(slots=True)
class Diagnosis:
    """One bridge's, over all openings of its link."""

    is_rosbridge: bool = False  # it answered a call, well or badly: nothing else does
    _answered_s: float | None = None  # the newest good answer of rosapi
    _sent_s: float | None = None  # the oldest call since the newest answer of any kind
    _cause: Cause | None = None  # of the newest failed answer; None: the newest answer was good
    _failures: int = 0  # failed answers in a row
    _text: str = ""  # of the newest failed answer
    _master_was_gone: bool = False  # on this opening
    _master_is_back: bool = False  # and rosapi answered since

    def opened(self) -> None:
        """Another connection: what was wrong behind the last one may be repaired."""
        self._sent_s, self._cause, self._failures = None, None, 0
        self._master_was_gone = self._master_is_back = False

    def answered(self, now_s: float) -> None:
        """rosapi answered a question."""
        self.is_rosbridge = True
        self._answered_s, self._sent_s, self._cause, self._failures = now_s, None, None, 0

    def failed(self, text: str) -> None:
        """The bridge answered a question with a failure, with this text."""
        self.is_rosbridge = True
        cause = cause_of(text)
        if cause == "killed" and self._sent_s is not None:
            return  # a ROS 1 bridge gives up after 5 s with the same error: rosapi hangs
        self._sent_s = None
        self._failures += 1
        self._cause, self._text = cause, text
        if self._cause == "no_master":
            self._master_was_gone, self._master_is_back = True, False

    def unanswered(self, sent_s: float) -> None:
        """A call at that time was not delayed by others and not answered in time."""
        if self._sent_s is None:
            self._sent_s = sent_s

    def master_restarted(self) -> bool:
        """Once after roscore was gone: rosapi answers again, with another roscore."""
        if not self._master_was_gone or self._master_is_back or self._cause is not None or self._failures:
            return False
        self._master_is_back = True
        return True

    @property
    def doubts(self) -> bool:
        """Whether the newest answer was a failure, which the next one should confirm soon."""
        return self._failures == 1

    def problem(self, now_s: float, *, flows: bool) -> Problem | None:
        """The part that failed; None: none is known to have. `flows`: messages of the car come."""
        was_there = self._answered_s is not None
        match self._cause:
            case "no_node":
                return connection_errors.BRIDGE_NODE_DEAD
            case "no_master":
                return connection_errors.ROSCORE_GONE
            case "missing" | "killed" if self._master_was_gone:
                return connection_errors.ROSCORE_RESTARTED
            case "missing" if self._failures > 1:  # ROS 2 may not have found rosapi yet
                return connection_errors.ROSAPI_ENDED if was_there else connection_errors.ROSAPI_MISSING
            case "killed" if self._failures > 1:
                return connection_errors.ROSAPI_ENDED
        if self._master_was_gone:
            return connection_errors.ROSCORE_RESTARTED
        if self._failures >= FAILURES:
            return connection_errors.rosapi_failing(self._text)
        if self._sent_s is not None and now_s - self._sent_s > SILENT_S:
            if flows:
                return connection_errors.ROSAPI_SILENT
            return connection_errors.ROS_GONE if was_there else connection_errors.BRIDGE_DEAF
        return None
