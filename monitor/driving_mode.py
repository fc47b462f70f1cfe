"""Who drives: from what the car reports, or by the rule that commands come and are followed. Else unknown.

A mode that the car reports is confirmed once messages have reported it for `CONFIRM_S`, and counts from the first of
them: a link that stalls confirms nothing. A mode that flickers is unknown until it has stood for `SETTLE_S`; its single
changes are counted, and reported once.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, Literal

from monitor.snapshot import Snapshot
from monitor.values import DriveMode, Mode

SourceKind = Literal["topic", "rule", "none"]

CONFIRM_S = 0.3
FLICKERS = 5  # changes …
FLICKERS_WITHIN_S = 5.0
SETTLE_S = 2.0
FOLLOWED_S = 2.0  # commands come, and the speed has been near them, for so long
NEAR_MPS, NEAR_SHARE = 0.8, 0.1  # a real car follows its commands loosely
COMMAND_HOLDS_S = 1.0
STANDS_MPS = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeChange:
    """The mode has changed."""

    at_s: float  # when the car first reported it
    mode: Mode
    before: Mode
    source: SourceKind
    flickers: int = 0  # single changes that were not reported one by one; of one that ends or begins such a time


def meaning(value: DriveMode, limits: Any) -> Mode:
    """The mode that a message reports; the settings define the meaning of plain numbers."""
    if value.number is None:
        return value.mode
    if value.number == limits.autonomous_number:
        return "autonomous"
    return "manual" if value.number == limits.manual_number else "unknown"


class ModeWatch:
    """Follows one car. `step` must be called with snapshots in the order of time."""

    def __init__(self) -> None:
        self.mode: Mode = "unknown"
        self.source: SourceKind = "none"
        self.since_s: float | None = None  # None: from the beginning on
        self.newest: Mode = "unknown"  # the newest, confirmed or not
        self.text = ""  # the car's own name of it, in the newest message
        self.changes_received = 0  # every single change of the mode that the car reports
        self._newest_s = -math.inf
        self._until_s = -math.inf  # until when it was reported
        self._numbered = 0
        self._flips: deque[float] = deque(maxlen=FLICKERS)
        self._flickers = 0
        self._is_flicker_reported = False
        self._rule = FollowedCommands()

    @property
    def is_flickering(self) -> bool:
        return self._is_flicker_reported

    def step(self, snapshot: Snapshot, limits: Any) -> list[ModeChange]:
        """What changed since the step before; `limits`: those of the group `driving`."""
        now_s = snapshot.now_s
        self._until_s = now_s
        by_rule = self._rule.step(snapshot)
        self.source = _source(snapshot, limits)
        if self.source == "topic":
            self._receive(snapshot, limits)
        else:
            self._follow(by_rule if self.source == "rule" else "unknown", self._rule.since_s)
        return self._settle(now_s)

    def _receive(self, snapshot: Snapshot, limits: Any) -> None:
        now_s, reading = snapshot.now_s, snapshot.get("mode")
        for received in snapshot.modes_received:
            if received.number > self._numbered:
                self._numbered = received.number
                self.text = received.value.text
                self._follow(meaning(received.value, limits), received.at_s)
        if reading is None or snapshot.link.phase != "monitoring":
            self._follow("unknown", now_s)
        elif reading.is_fresh(now_s) or 0.0 <= now_s - reading.received_s <= limits.holds_s:
            self._follow(meaning(reading.value, limits), now_s)
            if not limits.holds_s:  # else no second message is to be expected
                self._until_s = reading.received_s
        else:
            self._follow("unknown", now_s)

    def _follow(self, mode: Mode, at_s: float) -> None:
        if mode == self.newest:
            return
        self.newest, self._newest_s = mode, at_s
        self.changes_received += 1
        self._flips.append(at_s)
        self._flickers += 1

    def _settle(self, now_s: float) -> list[ModeChange]:
        if now_s < self._newest_s:  # the clock went back
            self._newest_s = now_s
            self._flips.clear()
        flips = self._flips
        if not self._is_flicker_reported and len(flips) == FLICKERS and flips[-1] - flips[0] <= FLICKERS_WITHIN_S:
            if now_s - self._newest_s < SETTLE_S:
                self._is_flicker_reported = True
                return [self._change("unknown", flips[0], self._flickers)]
            flips.clear()
        stood_s = self._until_s - self._newest_s
        if stood_s < (SETTLE_S if self._is_flicker_reported else CONFIRM_S):
            return []
        flickers, self._flickers = self._flickers, 0
        if self._is_flicker_reported:
            self._is_flicker_reported = False
            flips.clear()
            return [self._change(self.newest, self._newest_s, flickers)]
        return [] if self.newest == self.mode else [self._change(self.newest, self._newest_s, 0)]

    def _change(self, mode: Mode, at_s: float, flickers: int) -> ModeChange:
        change = ModeChange(at_s=at_s, mode=mode, before=self.mode, source=self.source, flickers=flickers)
        self.mode, self.since_s = mode, at_s
        return change


def _source(snapshot: Snapshot, limits: Any) -> SourceKind:
    if snapshot.get("mode") is not None or "mode" in snapshot.link.published:
        return "topic"
    return "rule" if limits.by_rule >= 1.0 else "none"


class FollowedCommands:
    """The rule: autonomous while commands come and the speed stays near them, manual where a moving car does other."""

    def __init__(self) -> None:
        self._commands: deque[tuple[float, float]] = deque(maxlen=64)  # s, m/s
        self._near_since_s: float | None = None
        self._far_since_s: float | None = None
        self._mode: Mode = "unknown"
        self.since_s = 0.0  # from when on this has been so

    def step(self, snapshot: Snapshot) -> Mode:
        now_s = snapshot.now_s
        speed, command = snapshot.get("speed"), snapshot.get("command")
        if speed is None or not speed.is_fresh(now_s) or command is None:
            self._commands.clear()
            self._near_since_s = self._far_since_s = None
            self._turn("unknown", now_s)
            return self._mode
        is_near = self._is_near(speed.value.speed_mps, snapshot)
        if is_near is None:  # a car that stands shows neither, and nothing once nobody commands it
            self._near_since_s = self._far_since_s = None
            if now_s - command.received_s > FOLLOWED_S:
                self._turn("unknown", command.received_s + FOLLOWED_S)
            return self._mode
        if is_near:
            self._far_since_s = None
            self._near_since_s = now_s if self._near_since_s is None else self._near_since_s
            if now_s - self._near_since_s >= FOLLOWED_S:
                self._turn("autonomous", self._near_since_s)
        else:
            self._near_since_s = None
            self._far_since_s = now_s if self._far_since_s is None else self._far_since_s
            if now_s - self._far_since_s >= FOLLOWED_S:
                self._turn("manual", self._far_since_s)
        return self._mode

    def _turn(self, mode: Mode, since_s: float) -> None:
        if mode != self._mode:
            self._mode, self.since_s = mode, since_s

    def _is_near(self, speed_mps: float, snapshot: Snapshot) -> bool | None:
        now_s, command = snapshot.now_s, snapshot.get("command")
        assert command is not None
        ordered_mps = command.value.speed_mps
        is_coming = -COMMAND_HOLDS_S <= now_s - command.received_s <= COMMAND_HOLDS_S
        if is_coming and ordered_mps is not None:
            if not self._commands or self._commands[-1][0] != command.received_s:
                self._commands.append((command.received_s, ordered_mps))
        while self._commands and not now_s - FOLLOWED_S <= self._commands[0][0] <= now_s:
            self._commands.popleft()
        if abs(speed_mps) <= STANDS_MPS and (not is_coming or ordered_mps is None or ordered_mps <= STANDS_MPS):
            return None
        if not is_coming or not self._commands:
            return False
        lowest = min(mps for _, mps in self._commands)
        highest = max(mps for _, mps in self._commands)
        spare = NEAR_MPS + NEAR_SHARE * abs(speed_mps)
        return lowest - spare <= speed_mps <= highest + spare
