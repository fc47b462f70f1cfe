"""Which phones can sound alarms now, by the status each page reports once a second. Pure: time is an argument."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

from monitor.shell_facts import ReachFacts
from server.control.lease import Operator
from server.protocol import serialize
from server.protocol.operator_state import ReachState, ReaderEnded, Ready

FRESH_S = 3.0  # a page that reported nothing for longer: its phone sleeps, or its radio link is lost
BLIND_S = 2.0  # a page without data for longer covers its values and gets no alarm
FORGOTTEN_S = 300.0  # a sleeping phone still counts among the operators for this time
MOST = 64
MOST_SHOWN = 12

REASONS: dict[ReaderEnded, str] = {
    "silent": "no contact",
    "blind": "link slow",
    "hidden": "page in the background",
    "undrawn": "page cannot draw",
    "sound": "sound off",
    "replay": "shows a replay",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Present:
    """The status that a page reports."""

    is_visible: bool
    sound: Ready
    awake: Ready  # whether the screen is kept on: a phone without that can alarm, until it falls asleep
    vibrates: bool = False
    battery: float | None = None  # 0 … 1; None: not available in the browser
    is_charging: bool | None = None
    lag_s: float = 0.0  # age of the newest state there
    is_replaying: bool = False
    is_drawing: bool = True  # false: it covers what it shows, because drawing failed


@dataclass(frozen=True, slots=True, kw_only=True)
class PageStatus:
    """The last status of one operator's page."""

    of: Operator
    status: Present
    heard_s: float
    command_s: float = -math.inf  # of its last command: the page runs then, whatever it shows

    def is_fresh(self, now_s: float) -> bool:
        return now_s - self.heard_s <= FRESH_S

    def is_seen(self, now_s: float) -> bool:
        """Whether somebody may be looking at it now."""
        return self.status.is_visible and now_s - max(self.heard_s, self.command_s) <= FRESH_S

    def why_not(self, now_s: float) -> ReaderEnded | None:
        """Why the page cannot sound an alarm now; None: it can."""
        if not self.is_fresh(now_s):
            return "silent"
        if not self.status.is_visible:
            return "hidden"
        if self.status.lag_s > BLIND_S:
            return "blind"
        if not self.status.is_drawing:
            return "undrawn"
        if self.status.is_replaying:
            return "replay"
        return None if self.status.sound == "ready" else "sound"


class AlarmReach:
    """The pages of operators that are here, or were within the last minutes."""

    def __init__(self) -> None:
        self._pages: dict[tuple[str, str], PageStatus] = {}  # oldest status first
        self._elsewhere: dict[tuple[str, str], PageStatus] = {}  # pages of other cars that announce this one's alarms

    def update_status(self, operator: Operator, status: Present, now_s: float) -> None:
        """Store the status of one page."""
        key = operator.who, operator.page
        self._pages.pop(key, None)
        self._pages[key] = PageStatus(of=operator, status=status, heard_s=now_s)
        self._forget(now_s)

    def note_command(self, operator: Operator, now_s: float) -> None:
        """A command came from a page: it is seen, unless it reported before that it is hidden."""
        key = operator.who, operator.page
        if key in self._pages:
            self._pages[key] = replace(self._pages[key], command_s=now_s)

    def leave(self, operator: Operator) -> None:
        """Remove a page that was closed."""
        self._pages.pop((operator.who, operator.page), None)

    def update_status_elsewhere(self, operator: Operator, status: Present, now_s: float) -> None:
        """Store the status of a page that shows another car and announces this one's alarms: it is not here."""
        key = operator.who, operator.page
        self._elsewhere.pop(key, None)
        self._elsewhere[key] = PageStatus(of=operator, status=status, heard_s=now_s)
        for old in list(self._elsewhere)[:-MOST]:
            del self._elsewhere[old]

    def leave_elsewhere(self, operator: Operator) -> None:
        """Remove a page that announces this car's alarms no more."""
        self._elsewhere.pop((operator.who, operator.page), None)

    def _forget(self, now_s: float) -> None:
        old = [key for key, one in self._pages.items() if now_s - one.heard_s > FORGOTTEN_S]
        for key in (*old, *list(self._pages)[: max(0, len(self._pages) - len(old) - MOST)]):
            self._pages.pop(key, None)

    def heard_s(self) -> float | None:
        """The time of the newest status of any page; None: no page."""
        return max((one.heard_s for one in self._pages.values()), default=None)

    def is_here(self, operator: Operator, now_s: float) -> bool:
        one = self._pages.get((operator.who, operator.page))
        return one is not None and one.is_seen(now_s)

    def find(self, page: str, now_s: float) -> Operator | None:
        """The operator of a page that is here and seen."""
        return next((one.of for one in self._pages.values() if one.of.page == page and one.is_seen(now_s)), None)

    def people(self, now_s: float) -> list[Operator]:
        """Whose page is seen, here or on a page that announces this car's alarms, in the order of their names."""
        seen = {key: one.of for key, one in (self._elsewhere | self._pages).items() if one.is_seen(now_s)}
        return sorted(seen.values(), key=lambda one: (one.name, one.page))

    def all(self, now_s: float) -> list[PageStatus]:
        """Every page that counts, in the order of their names."""
        self._forget(now_s)
        return sorted(self._pages.values(), key=lambda one: (one.of.name, one.of.page))

    def _announcing(self, now_s: float) -> list[PageStatus]:
        """The pages of other cars that would sound an alarm of this one now; of the others nothing is expected."""
        return [one for one in self._elsewhere.values() if one.why_not(now_s) is None]

    def facts(self, now_s: float) -> ReachFacts:
        """For the check. Two pages of one device are one operator."""
        best = _by_device((*self.all(now_s), *self._announcing(now_s)), now_s)
        reasons = Counter(REASONS[why] for why in best.values() if why is not None)
        return ReachFacts(
            can=sum(why is None for why in best.values()),
            of=len(best),
            why=", ".join(why if many == 1 else f"{many} × {why}" for why, many in sorted(reasons.items())),
        )

    def as_json(self, now_s: float) -> ReachState:
        """The `reach` of a state."""
        pages, facts = self.all(now_s), self.facts(now_s)
        return {
            "can": facts.can,
            "of": facts.of,
            "why": facts.why,
            "pages": [
                {
                    "page": one.of.page,
                    "name": one.of.name,
                    "can": (why := one.why_not(now_s)) is None,
                    "why": why,
                    "why_text": REASONS[why] if why else None,
                    "here": one.is_seen(now_s),
                    "awake": one.status.awake,
                    "vibrates": one.status.vibrates,
                    "battery": serialize.plain(one.status.battery, 2),
                    "charging": one.status.is_charging,
                    "heard_s": serialize.plain(max(0.0, now_s - one.heard_s), 1),
                }
                for one in pages[:MOST_SHOWN]
            ],
            "left_out": max(0, len(pages) - MOST_SHOWN),
        }


def _by_device(pages: Iterable[PageStatus], now_s: float) -> dict[tuple[str, str], ReaderEnded | None]:
    """Of each operator's device why none of its pages can alarm; None: one of them can."""
    best: dict[tuple[str, str], ReaderEnded | None] = {}
    for one in pages:
        key, why = (one.of.who, one.of.name), one.why_not(now_s)
        if key not in best or why is None:
            best[key] = why
    return best
