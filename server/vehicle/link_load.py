"""Throttling on a slow link: the slower the link, the fewer messages; judged signals are reduced last. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.signals import SIGNALS

STEP_ABOVE_S = 0.5  # a delay above this, beyond the link's round trip, starts throttling
LASTING_S = 0.4  # a burst after a hiccup of the radio is over by then
STEEP_ABOVE_S = 1.5  # later than this, the least at once
STEP_EVERY_S = 1.0  # what was taken away needs so long to show
FALLING_S = 0.1  # lateness that falls by so much in that time needs no more
RESTORE_BELOW_S = 0.35
RESTORE_AFTER_S = 1.0  # in time for so long: one step back
PATIENCE_AT_MOST_S = 300.0
RELAPSE_WITHIN_S = 15.0  # late again so soon after a step back: the next one waits twice as long
TRIED_S = 3.0  # so long after a step back the least lateness is enough to take it again
CHANGED_BY = 0.5  # a round trip that is shorter than so much of that at the last step back is of another link …
SETTLED_S = 3.5  # … once what waited before does not count any more (`monitor.transport.WINDOW_S`)
SETTLE_S = 6.0  # rates are measured over 5 s

SCANS = frozenset({"scan"})
TRENDS = frozenset(name for name, signal in SIGNALS.items() if signal.optional)


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """The throttling of one step."""

    text: str  # what is not received in full, as a sentence
    records_others: bool = False
    scan_ms: int = 0
    trends_ms: int = 0
    judged_ms: int = 0


LEVELS = (
    Level(text="Everything is received", records_others=True),
    Level(text="Topics that are only recorded are not subscribed"),
    Level(
        text="Topics that are only recorded are not subscribed, scans and trends are throttled",
        scan_ms=200,
        trends_ms=500,
    ),
    Level(
        text="Topics that are only recorded are not subscribed, all signals are throttled",
        scan_ms=500,
        trends_ms=500,
        judged_ms=100,
    ),
    Level(
        text="Topics that are only recorded are not subscribed, all signals are limited to 5 Hz",
        scan_ms=500,
        trends_ms=500,
        judged_ms=200,
    ),
)


class LinkLoad:
    """Decides the step, from how late the link is."""

    def __init__(self) -> None:
        self.step = 0
        self._late_since_s: float | None = None
        self._late_before_s = 0.0
        self._looked_s: float | None = None
        self._in_time_since_s: float | None = None
        self._restored_s: float | None = None
        self._restored_trip_s = 0.0  # the round trip when the last step back was made
        self._patience_s = RESTORE_AFTER_S
        self._judged_since_s: dict[str, float] = {}

    @property
    def level(self) -> Level:
        return LEVELS[self.step]

    def look(self, late_s: float, now_s: float, trip_s: float) -> bool:
        """`late_s`: of what comes, beyond what the link needs when nothing waits; `trip_s`: the least of the last
        round trips. True where the step changed."""
        before = self.step
        is_tried = self._restored_s is not None and now_s - self._restored_s <= TRIED_S
        is_late = late_s > (RESTORE_BELOW_S if is_tried else STEP_ABOVE_S)
        if not is_late:
            self._late_since_s = None
        if is_late:
            self._in_time_since_s = None
            if self._late_since_s is None:
                self._late_since_s = now_s
            if now_s - self._late_since_s >= LASTING_S:
                self._more_late(late_s, now_s, is_tried)
        elif late_s > RESTORE_BELOW_S:
            self._in_time_since_s = None
        elif self._in_time_since_s is None:
            self._in_time_since_s = now_s
        elif self.step:
            self._less_late(now_s - self._in_time_since_s, now_s, trip_s)
        return self.step != before

    def _less_late(self, in_time_s: float, now_s: float, trip_s: float) -> None:
        is_settled = in_time_s >= SETTLED_S
        if is_settled and trip_s < CHANGED_BY * self._restored_trip_s:
            self._patience_s = RESTORE_AFTER_S
        if in_time_s >= self._patience_s:
            self.step -= 1
            self._restored_s = self._in_time_since_s = now_s
            if is_settled:
                self._restored_trip_s = trip_s

    def _more_late(self, late_s: float, now_s: float, is_tried: bool) -> None:
        top = len(LEVELS) - 1
        if is_tried:
            self._looked_s, self._late_before_s, is_falling = now_s, late_s, False
        elif self._looked_s is None or now_s - self._looked_s >= STEP_EVERY_S:
            is_falling = self._looked_s is not None and late_s < self._late_before_s - FALLING_S
            self._looked_s, self._late_before_s = now_s, late_s
        else:
            is_falling = True  # too early
        if self.step < top and (late_s > STEEP_ABOVE_S or not is_falling):
            if self._restored_s is not None and now_s - self._restored_s <= RELAPSE_WITHIN_S:
                self._patience_s = min(2.0 * self._patience_s, PATIENCE_AT_MOST_S)
                self._restored_s = None
            self.step = top if late_s > STEEP_ABOVE_S else self.step + 1

    def relapse_is_explained(self) -> None:
        """One topic that was tried made the link late: the others need not wait longer for it."""
        self._patience_s = RESTORE_AFTER_S

    def throttle_ms(self, signal: str) -> int:
        """At most one message of this signal in so many milliseconds; 0: all."""
        level = self.level
        if signal in SCANS:
            return level.scan_ms
        return level.trends_ms if signal in TRENDS else level.judged_ms

    def throttled(self, now_s: float) -> frozenset[str]:
        """The signals whose rate is set by our throttle, and until it is measured again."""
        if self.step:
            # Also where nothing is throttled: the bridge keeps one message of each, and loses the others of a burst.
            self._judged_since_s.update(dict.fromkeys(SIGNALS, now_s))
        return frozenset(name for name, at_s in self._judged_since_s.items() if now_s - at_s <= SETTLE_S)
