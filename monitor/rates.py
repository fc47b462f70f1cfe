"""How often a signal comes, how often it should, and from when on its silence is a fault."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median_low

WINDOW_S = 5.0  # window of the measured rate: long against Wi-Fi bunching, short for the operator …
WINDOW_PERIODS = 5  # … or this many periods, for slow signals
STALE_PERIODS = 10  # tolerates bunching on Wi-Fi …
STALE_FLOOR_S = 1.0  # … and no shorter than this for fast signals
STARTING_S = (
    2.0  # before the rate is settled: lets a 1 Hz car pass where 10 Hz is usual, and still keeps the promise of 2 s
)
UNDECLARED_S = 10.0  # before the rate of a signal that may have any rate is settled
BLOCK_S = 2.5  # two blocks in a row that agree are a steady rate: 5 s after connecting at the earliest
BLOCK_INTERVALS = 5
STEADY_WITHIN = 0.1  # relative
PROVISIONAL_BLOCKS = 6  # so long a learned rate is refined: its first blocks may include a burst after a stall
HICCUP_SHARE = 0.8  # a block below this share of the learned rate is a source that slowed down, and refines nothing
DECIDED_BLOCKS = 4  # without agreement by then, the declared rate applies


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """Messages per second of one signal."""

    measured_hz: float | None  # over the sliding window; None: too few messages; 0.0: silent
    expected_hz: float | None  # None: neither declared, set nor learned
    settled: bool  # whether `expected_hz` may be held against the car
    learning: bool = False  # whether it may still settle; a signal without a default that never keeps a rate does not


class RateMeter:
    """Follows the arrivals of one signal.

    The expected rate is, in this order: the operator's; the car's own steady rate; the declared default. Rates differ
    between healthy cars (a scan at 10, 30 or 75 Hz), so a rate that holds for two blocks of 2.5 s is learned. After a
    stall messages arrive faster than their source for some seconds: the median of the blocks of the next 15 s replaces
    the first learned rate. Later only a steadily *higher* rate is learned: a falling one must raise an alarm.
    """

    __slots__ = (
        "_arrivals",
        "_block_due_s",
        "_block_from",
        "_block_start_s",
        "_blocks",
        "_declared_hz",
        "_first_s",
        "_heard",
        "_held_period_s",
        "_held_s",
        "_is_settled",
        "_last_block_hz",
        "_last_s",
        "_learned_blocks",
        "_learned_hz",
        "_learned_hz_before",
        "_set_hz",
        "horizon_s",
        "period_s",
    )

    # Both are read at every message, and change seldom.
    period_s: float | None  # between two messages as far as known; until settled the longer of declared and observed
    # Age from which a reading is stale: max(10 periods, 1 s), more until the rate is settled, or as `hold` has it.
    horizon_s: float

    def __init__(self, declared_hz: float | None, set_hz: float | None = None) -> None:
        self._declared_hz = declared_hz
        self._set_hz = set_hz
        self._learned_hz: float | None = None
        self._learned_hz_before: float | None = None  # what a step up took the place of
        self._learned_blocks: list[float] = []  # Hz of the blocks it is the median of, while it is provisional
        self._blocks = 0
        self._arrivals: deque[float] = deque(maxlen=20_000)
        self._is_settled = False
        self._held_s: float | None = None
        self._held_period_s: float | None = None
        self.restart()

    def restart(self) -> None:
        """Restart the measurement after a gap; the learned rate stays."""
        self._arrivals.clear()
        self._first_s = 0.0
        self._last_s: float | None = None
        self._heard = 0
        self._begin_block(0.0)
        self._last_block_hz: float | None = None
        self._settle()

    def expect(self, set_hz: float | None) -> None:
        """Set the operator's own rate; None or 0: learn it."""
        self._set_hz = set_hz or None
        self._settle()

    def hold(self, horizon_s: float, period_s: float | None) -> None:
        """The horizon and the period [s] from now on, unless the operator set a rate: of a signal that comes in parts.

        `period_s` None: it is not known, and what is observed counts.
        """
        if (horizon_s, period_s) != (self._held_s, self._held_period_s):
            self._held_s, self._held_period_s = horizon_s, period_s
            self._settle()

    def receive(self, at_s: float) -> None:
        last_s = self._last_s
        if last_s is None or not last_s <= at_s <= last_s + self.horizon_s:
            # A stale signal has its own alarm; after the clock went back the rate is unknown.
            self.restart()
            self._first_s = at_s
            self._heard = 1
            self._begin_block(at_s)
        else:
            self._heard += 1
        self._last_s = at_s
        self._arrivals.append(at_s)
        if at_s >= self._block_due_s and self._heard - self._block_from >= BLOCK_INTERVALS:
            self._end_block(at_s)
        if not self._is_settled:
            self._settle()

    @property
    def expected_hz(self) -> float | None:
        return self._set_hz or self._learned_hz or self._declared_hz

    @property
    def is_settled(self) -> bool:
        if self._set_hz or self._learned_hz:
            return True
        return self._declared_hz is not None and self._blocks >= DECIDED_BLOCKS

    def rate(self, now_s: float) -> Rate:
        return Rate(
            measured_hz=self.measured_hz(now_s),
            expected_hz=self.expected_hz,
            settled=self.is_settled,
            learning=self._blocks < DECIDED_BLOCKS,
        )

    def measured_hz(self, now_s: float) -> float | None:
        """Intervals per second within the window; a pause still going on counts from its first missed message."""
        if self._last_s is None:
            return None
        self._forget(now_s)
        arrivals = self._arrivals
        if now_s - self._last_s > self.horizon_s:
            return 0.0
        if len(arrivals) < 2:
            return None
        first_s, last_s = arrivals[0], arrivals[-1]
        span_s = max(last_s, now_s - (self.period_s or 0.0)) - first_s
        return (len(arrivals) - 1) / span_s if span_s > 0.0 else None

    def _forget(self, now_s: float) -> None:
        if now_s - self._arrivals[0] <= WINDOW_S:
            return
        window_s = max(WINDOW_S, WINDOW_PERIODS * (self.period_s or 0.0))
        arrivals = self._arrivals
        while len(arrivals) > 2 and now_s - arrivals[0] > window_s:
            arrivals.popleft()

    def _begin_block(self, at_s: float) -> None:
        """With the message that came now."""
        self._block_start_s, self._block_due_s, self._block_from = at_s, at_s + BLOCK_S, self._heard

    def _end_block(self, at_s: float) -> None:
        block_hz = (self._heard - self._block_from) / (at_s - self._block_start_s)
        before_hz, self._last_block_hz = self._last_block_hz, block_hz
        self._begin_block(at_s)
        self._blocks += 1
        self._refine(block_hz)
        self._agree(block_hz, before_hz)
        self._settle()

    def _agree(self, block_hz: float, before_hz: float | None) -> None:
        if before_hz is None or abs(block_hz - before_hz) > STEADY_WITHIN * max(block_hz, before_hz):
            return
        learned_hz = self._learned_hz
        # Only a clear step up is a new rate: following every small rise would raise the expected rate step by step.
        if learned_hz is None or min(block_hz, before_hz) > (1 + STEADY_WITHIN) * learned_hz:
            self._learned_hz_before = learned_hz
            self._learned_blocks = [before_hz, block_hz]
            self._learned_hz = (before_hz + block_hz) / 2

    def _refine(self, block_hz: float) -> None:
        """Takes the median of more blocks for a rate just learned; a step up that does not last is taken back."""
        learned_hz = self._learned_hz
        if not self._learned_blocks or learned_hz is None:
            return
        if block_hz < HICCUP_SHARE * learned_hz or len(self._learned_blocks) > PROVISIONAL_BLOCKS:
            self._learned_blocks = []
            return
        self._learned_blocks.append(block_hz)
        self._learned_hz = median_low(self._learned_blocks)
        before_hz = self._learned_hz_before
        if before_hz is not None and self._learned_hz <= (1 + STEADY_WITHIN) * before_hz:
            self._learned_hz, self._learned_blocks = before_hz, []

    def _settle(self) -> None:
        """To be called whenever what is expected may have changed, and until it is settled at every message."""
        expected_hz = self.expected_hz
        self._is_settled = self.is_settled and expected_hz is not None
        if self._is_settled and expected_hz is not None:
            self.period_s = 1.0 / expected_hz
            self.horizon_s = max(STALE_PERIODS * self.period_s, STALE_FLOOR_S)
        else:
            self.period_s = self._observed_s(expected_hz)
            floor_s = STARTING_S if self._declared_hz is not None else UNDECLARED_S
            self.horizon_s = max(STALE_PERIODS * (self.period_s or 0.0), floor_s)
        if self._held_s is not None and not self._set_hz:
            self.horizon_s = self._held_s
            self.period_s = self._held_period_s or self.period_s

    def _observed_s(self, expected_hz: float | None) -> float | None:
        if self._heard < 2 or self._last_s is None:
            return None if expected_hz is None else 1.0 / expected_hz
        observed_s = (self._last_s - self._first_s) / (self._heard - 1)
        period_s = observed_s if expected_hz is None else max(observed_s, 1.0 / expected_hz)
        return period_s if period_s > 0.0 else None
