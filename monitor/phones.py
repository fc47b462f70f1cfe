"""The phones that share their position, the one that is compared with the car, and the comparisons.

Several pages can share a position; one is compared. If the operator chose the phone in the car, only that one. Else
the first phone with a usable position stays selected as long as it has one, and for 10 s more; then the next in order
of arrival follows. The car's position is interpolated at the phone's time, so the rates of both do not matter.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Literal

from monitor.agreement import Pair, Tracks, correlate, gate_m, phone_sigma_m
from monitor.geo import course_deg, offset_m
from monitor.tracks import Trail
from monitor.values import GpsFix, PhoneFix

WORST_ACCURACY_M = 50.0  # a worse one comes from masts and access points
FIX_LIVES_S = 5.0  # phones send their position about once a second
UNCERTAIN_AT_MOST_S = 1.0  # uncertainty of a fix's time: a message delayed by the radio is not current
SILENT_AFTER_S = 5.0  # a page reports at least every 3 s, with or without a position
HOLD_S = 10.0
FORGOTTEN_AFTER_S = 60.0
MOST = 32
UNCERTAIN_S = 0.3  # beside that: the phone's own delay, and what a radio bunches of the car's positions
COMPARISONS = 5
COMPARED_WITHIN_S = 15.0
TRACK_S = 60.0
STEP_S = 0.25  # closer fixes are not new, and bound the cost of a page that floods

Why = Literal["denied", "unavailable", "timeout", "insecure", "hidden", "off", "coarse", "old", "late", "silent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneReport:
    """The position of one phone, or the reason for none. Times are of the receiver's monotonic clock."""

    phone: str  # its own name for itself, the same over reconnections
    is_handheld: bool  # not a desktop computer, of which no GPS is expected
    label: str = ""  # the operator's name for it
    fix: PhoneFix | None = None
    measured_s: float = 0.0  # when it was there …
    uncertain_s: float = 0.0  # … give or take
    why: Why | None = None  # without a fix; "off": it leaves


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Phone and car at one moment."""

    at_s: float
    distance_m: float
    gate_m: float  # what the errors of both explain in this direction
    bearing_deg: float = 0.0  # compass bearing of the car as seen from the phone


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneView:
    """The phone that is compared, at one moment."""

    phone: str | None = None  # None: none has reported
    label: str = ""
    count: int = 0  # phones that reported within the last minute
    is_handheld: bool = False
    received_s: float = -math.inf
    usable_s: float = -math.inf  # the moment of its newest usable fix; before there is one, of its first report
    fix: PhoneFix | None = None  # the newest, usable or not
    measured_s: float = -math.inf
    was_usable: bool = False  # it had a usable position before
    why: Why | None = None  # why its newest report has no usable fix
    is_chosen: bool = False  # the operator selected it as the phone in the car
    comparisons: tuple[Comparison, ...] = ()  # the newest five, oldest first
    tracks: Tracks | None = None  # over the last minute, of places that the gate explains

    def is_there(self, now_s: float) -> bool:
        """Whether a phone is to be compared at all: it was chosen, or it reported within a minute and did not leave."""
        return self.phone is not None and (self.is_chosen or now_s - self.received_s <= FORGOTTEN_AFTER_S)

    def why_not(self, now_s: float) -> Why | None:
        """Why this phone has no position that can be used now; None where it has."""
        if self.why == "off":
            return "off"
        if now_s - self.received_s > SILENT_AFTER_S:
            return "silent"
        if self.why is not None:
            return self.why
        return "old" if now_s - self.measured_s > FIX_LIVES_S else None

    def missing_s(self, now_s: float) -> float:
        """For how long there has been no usable position [s]."""
        return max(0.0, now_s - self.usable_s)


NO_PHONE = PhoneView()


@dataclass(slots=True, kw_only=True)
class _Phone:
    """One phone, as of its newest report."""

    name: str
    usable_s: float
    label: str = ""
    is_handheld: bool = True
    received_s: float = -math.inf
    selected_s: float = -math.inf  # when the operator selected it before its first report
    fix: PhoneFix | None = None
    measured_s: float = -math.inf
    why: Why | None = None
    was_usable: bool = False  # ever


class Phones:
    """Takes the reports of the phones and the positions of the car; `view` is what the checks judge by."""

    def __init__(self) -> None:
        self.view = NO_PHONE
        self.views: tuple[PhoneView, ...] = ()  # every phone, in the order in which they came; without comparisons
        self._selected: str | None = None  # the one that the operator selected
        self._phones: dict[str, _Phone] = {}  # in the order in which they came
        self._chosen: str | None = None
        self._trail = Trail()
        self._waiting: PhoneReport | None = None  # the chosen phone's fix, until the car's next position comes
        self._comparisons: deque[Comparison] = deque(maxlen=COMPARISONS)
        self._pairs: deque[Pair] = deque(maxlen=round(TRACK_S / STEP_S) + 1)
        self._tracks: Tracks | None = None
        self._compared_s = -math.inf

    def receive(self, report: PhoneReport, now_s: float) -> None:
        """Take one report of one phone."""
        self._phones = {
            n: p for n, p in self._phones.items() if n == self._selected or now_s - p.received_s <= FORGOTTEN_AFTER_S
        }
        if report.why == "off" and report.phone != self._selected:
            self._phones.pop(report.phone, None)
        elif report.phone in self._phones or len(self._phones) < MOST:
            self._note(report, now_s)
        self._choose(now_s)
        if report.phone == self._chosen and report.fix is not None and self._phones[report.phone].why is None:
            if report.measured_s >= self._compared_s + STEP_S:
                self._waiting = report
                self._compare()
        self._look()

    def ride(self, phone: str | None, now_s: float) -> None:
        """Set the phone that is in the car: only this one is compared. It need not have reported yet. None: one is
        chosen automatically."""
        expected = self._phones.get(self._selected or "")
        if expected is not None and expected.received_s == -math.inf:
            del self._phones[expected.name]  # it was only waited for
        self._selected = phone
        if phone is not None and phone not in self._phones:
            self._phones[phone] = _Phone(name=phone, usable_s=now_s, selected_s=now_s)
        self._choose(now_s)
        self._look()

    def car(self, fix: GpsFix, at_s: float) -> None:
        """One position of the car."""
        self._trail.add(fix, at_s)
        if self._waiting is not None and self._compare():
            self._look()

    def _note(self, report: PhoneReport, now_s: float) -> None:
        phone = self._phones.get(report.phone)
        if phone is None:
            phone = self._phones[report.phone] = _Phone(name=report.phone, usable_s=now_s)
        phone.received_s, phone.is_handheld, phone.why, phone.label = (
            now_s,
            report.is_handheld,
            report.why,
            report.label,
        )
        if report.fix is None:
            return
        phone.fix, phone.measured_s = report.fix, report.measured_s
        phone.why = _why_not_usable(report.fix, now_s - report.measured_s, report.uncertain_s)
        if phone.why is None:
            phone.usable_s, phone.was_usable = report.measured_s, True

    def _choose(self, now_s: float) -> None:
        if self._selected is not None:
            self._compare_only(self._selected)
            return
        chosen = self._phones.get(self._chosen or "")
        if chosen is not None and chosen.was_usable and now_s - chosen.usable_s <= HOLD_S:
            return
        found = next(
            (p for p in self._phones.values() if p.was_usable and p.why is None and now_s - p.usable_s <= FIX_LIVES_S),
            None,
        )
        if found is None:  # none can be compared: the expected one is reported
            rest = sorted(self._phones.values(), key=lambda p: (not p.is_handheld, p.name != self._chosen))
            found = rest[0] if rest else None
        self._compare_only(None if found is None else found.name)

    def _compare_only(self, name: str | None) -> None:
        """Compare this phone from now on; the comparisons of another are dropped."""
        if name != self._chosen:
            self._chosen, self._waiting = name, None
            self._comparisons.clear()
            self._pairs.clear()
            self._tracks, self._compared_s = None, -math.inf

    def _compare(self) -> bool:
        """Compares the fix that waits, if the car's positions have reached its moment; whether it was."""
        report = self._waiting
        if report is None or report.fix is None or self._trail.newest_s < report.measured_s:
            return False
        self._waiting = None
        place = self._trail.at(report.measured_s)
        if place is None:
            return False
        fix, at_s, sigma_m = report.fix, report.measured_s, phone_sigma_m(report.fix.accuracy_m)
        east_m, north_m = offset_m(place.lat_deg, place.lon_deg, fix.lat_deg, fix.lon_deg)
        gate = gate_m(
            east_m,
            north_m,
            car_sigma_m=place.sigma_m,
            phone_sigma_m=sigma_m,
            velocity_mps=place.velocity_mps,
            uncertain_s=UNCERTAIN_S + report.uncertain_s,
        )
        one = Comparison(
            at_s=at_s,
            distance_m=math.hypot(east_m, north_m),
            gate_m=gate,
            bearing_deg=course_deg(-east_m, -north_m),
        )
        self._compared_s = at_s
        self._comparisons.append(one)
        while self._comparisons[0].at_s < at_s - COMPARED_WITHIN_S:
            self._comparisons.popleft()
        if one.distance_m <= one.gate_m:  # otherwise the gate reports it, and it would distort a minute of the track
            self._pairs.append(
                Pair(
                    at_s=at_s,
                    phone_lat_deg=fix.lat_deg,
                    phone_lon_deg=fix.lon_deg,
                    phone_sigma_m=sigma_m,
                    car_lat_deg=place.lat_deg,
                    car_lon_deg=place.lon_deg,
                )
            )
        while self._pairs and self._pairs[0].at_s < at_s - TRACK_S:
            self._pairs.popleft()
        self._tracks = correlate(self._pairs)
        return True

    def _look(self) -> None:
        self.views = tuple(self._view(phone) for phone in self._phones.values())
        phone = self._phones.get(self._chosen or "")
        if phone is None:
            self.view = NO_PHONE
            return
        self.view = replace(self._view(phone), comparisons=tuple(self._comparisons), tracks=self._tracks)

    def _view(self, phone: _Phone) -> PhoneView:
        return PhoneView(
            phone=phone.name,
            label=phone.label,
            count=len(self._phones),
            is_handheld=phone.is_handheld,
            received_s=max(phone.received_s, phone.selected_s),
            usable_s=phone.usable_s,
            fix=phone.fix,
            measured_s=phone.measured_s,
            was_usable=phone.was_usable,
            why=phone.why,
            is_chosen=phone.name == self._selected,
        )


def _why_not_usable(fix: PhoneFix, age_s: float, uncertain_s: float) -> Why | None:
    if uncertain_s > UNCERTAIN_AT_MOST_S:
        return "late"
    if age_s > FIX_LIVES_S:
        return "old"
    return None if fix.accuracy_m <= WORST_ACCURACY_M else "coarse"
