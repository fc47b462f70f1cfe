"""Where the car and the phones were, and where alarms were raised: what GPX and GeoJSON draw from."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from monitor.geo import is_at_zero
from monitor.values import STATUS_UNSET, GpsFix
from server.recording.export.decoded_drive import DecodedDrive
from server.recording.export.export_format import ExportRefused, Progress, nothing
from server.recording.marks.recorded import marks_of, title_of

GAP_S = 5.0  # after this time without a position a new track starts, as on the map
NEAR_S = 5.0  # an alarm is active where the car was, if it was known within so long
MOST_PHONES = 50  # a track each
UNKNOWN, NO_FIX = "without a known status", "without a fix"
AT_ZERO, NO_PLACE = "with coordinates 0, 0", "without valid coordinates"
_RAISED = ("raised", "recaused")


@dataclass(slots=True)
class Track:
    """Positions on WGS84 in the order of time; 32 bytes a point."""

    at_s: array[float] = field(default_factory=lambda: array("d"))  # since 1970
    lat_deg: array[float] = field(default_factory=lambda: array("d"))
    lon_deg: array[float] = field(default_factory=lambda: array("d"))
    alt_m: array[float] = field(default_factory=lambda: array("d"))  # above the ellipsoid; NaN: not known

    def add(self, at_s: float, lat_deg: float, lon_deg: float, alt_m: float | None) -> None:
        self.at_s.append(at_s)
        self.lat_deg.append(lat_deg)
        self.lon_deg.append((lon_deg + 180.0) % 360.0 - 180.0)  # −180 ≤ lon < 180
        self.alt_m.append(math.nan if alt_m is None else alt_m)

    def stretches(self) -> Iterator[range]:
        """The points from one gap to the next."""
        first = 0
        for index in range(1, len(self.at_s)):
            if not 0.0 <= self.at_s[index] - self.at_s[index - 1] <= GAP_S:
                yield range(first, index)
                first = index
        if self.at_s:
            yield range(first, len(self.at_s))

    def near(self, at_s: float) -> int | None:
        """The point nearest in time, None where the position was not known then."""
        index = bisect_left(self.at_s, at_s)
        around = [i for i in (index - 1, index) if 0 <= i < len(self.at_s)]
        best = min(around, key=lambda i: abs(self.at_s[i] - at_s), default=None)
        return best if best is not None and abs(self.at_s[best] - at_s) <= NEAR_S else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the car was when an alarm was raised, or somebody marked the moment."""

    at_s: float
    lat_deg: float
    lon_deg: float
    alt_m: float
    event: Mapping[str, Any]

    @property
    def title(self) -> str:
        return str(self.event.get("title") or self.event.get("alarm") or "Alarm")

    @property
    def text(self) -> str:
        return str(self.event.get("text") or "")

    @property
    def priority(self) -> str:
        return str(self.event.get("priority") or "")


@dataclass(slots=True)
class Tracks:
    """All of a drive."""

    name: str
    car: Track = field(default_factory=Track)
    phones: dict[str, Track] = field(default_factory=dict)
    alarms: list[Place] = field(default_factory=list)
    marks: list[Place] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # what is not in it
    notices: list[str] = field(default_factory=list)

    @property
    def points(self) -> int:
        return len(self.car.at_s) + sum(len(track.at_s) for track in self.phones.values()) + self.places

    @property
    def places(self) -> int:
        return len(self.alarms) + len(self.marks)


def tracks_of(drive: DecodedDrive, progress: Progress = nothing) -> Tracks:
    """Raises ExportRefused where there is no position of car or phone, RecordingUnreadable."""
    recording = drive.recording
    tracks = Tracks(name=f"{recording.metadata.get('vehicle') or 'car'} {when(recording.start_s)}")

    left_out: Counter[str] = Counter()

    def add(signal: str, fix: GpsFix, at_s: float, stamp_s: float | None) -> None:
        why_not = _why_not(fix)
        if why_not is None:
            tracks.car.add(at_s, fix.lat_deg, fix.lon_deg, fix.alt_m)
        else:
            left_out[why_not] += 1

    drive.read(add, signals={"position"}, progress=progress)
    _phones(drive, tracks)
    rejected = sum(tally.rejected for tally in drive.reception.by_signal.values())
    if not tracks.points and (left_out or rejected):
        raise ExportRefused(" ".join(["There is no track to export.", *_left_out(left_out), *drive.losses()]))
    if not tracks.points:
        raise ExportRefused("No position was recorded in this drive: there is no track to export.")
    if not tracks.car.at_s:
        what = "has no usable position" if left_out or rejected else "published no position"
        tracks.notices.append(f"The car {what}: only that of the phone is in the file.")
    # What has no fix is no position; what does not say so may be one.
    tracks.notes += _left_out({UNKNOWN: left_out.pop(UNKNOWN, 0)})
    tracks.notices += _left_out(left_out)
    _alarms(drive, tracks)
    _marks(drive, tracks)
    tracks.notes += drive.losses()
    return tracks


def _why_not(fix: GpsFix) -> str | None:
    """Why a position is not a point of a track; None: it is one."""
    if fix.is_unset:
        return AT_ZERO
    if fix.status == STATUS_UNSET:
        return UNKNOWN
    if fix.status < 0:
        return NO_FIX
    return None if _is_place(fix.lat_deg, fix.lon_deg) else NO_PLACE


def _left_out(counts: Mapping[str, int]) -> list[str]:
    return [f"Left out: {count} position{'' if count == 1 else 's'} {why}." for why, count in counts.items() if count]


def when(at_s: float) -> str:
    """A time of day as ISO 8601 in UTC, to the millisecond; the first second of 1970 for what no calendar has."""
    try:
        moment = datetime.fromtimestamp(at_s, UTC)
    except (OverflowError, ValueError, OSError):
        moment = datetime.fromtimestamp(0, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _phones(drive: DecodedDrive, tracks: Tracks) -> None:
    unfit, beyond = 0, set()
    for at_s, entry in drive.recording.own("/catgraph/phone"):
        fix = entry.get("fix")
        if not isinstance(fix, Mapping):
            continue
        lat_deg, lon_deg = _number(fix.get("lat_deg")), _number(fix.get("lon_deg"))
        if lat_deg is None or lon_deg is None or not _is_place(lat_deg, lon_deg) or is_at_zero(lat_deg, lon_deg):
            unfit += 1
            continue
        name = str(entry.get("phone") or "phone")[:80]
        if name not in tracks.phones and len(tracks.phones) >= MOST_PHONES:
            beyond.add(name)
            continue
        age_s = _number(fix.get("age_s")) or 0.0
        measured_s = at_s - age_s if 0.0 <= age_s <= 60.0 else at_s
        tracks.phones.setdefault(name, Track()).add(measured_s, lat_deg, lon_deg, _number(fix.get("alt_m")))
    if unfit:
        tracks.notes.append(f"{unfit} positions of phones are left out: they are not valid coordinates.")
    if beyond:
        tracks.notes.append(f"{len(beyond)} phones are left out: {MOST_PHONES} is the limit.")


def _alarms(drive: DecodedDrive, tracks: Tracks) -> None:
    nowhere = 0
    for at_s, event in drive.recording.own("/catgraph/alarms"):
        if event.get("alarm") is None or event.get("change") not in _RAISED:
            continue
        place = _place(tracks.car, at_s, event)
        if place is None:
            nowhere += 1
        else:
            tracks.alarms.append(place)
    if nowhere:
        what = "1 alarm was" if nowhere == 1 else f"{nowhere} alarms were"
        tracks.notes.append(f"{what} raised while the car's position was unknown, and cannot be drawn.")


def _marks(drive: DecodedDrive, tracks: Tracks) -> None:
    """Each with its category or the beginning of its text as its title."""
    nowhere = 0
    for mark in marks_of(drive.recording):
        place = _place(tracks.car, mark["marked_ms"] / 1000, {**mark, "title": title_of(mark), "text": mark["words"]})
        if place is None:
            nowhere += 1
        else:
            tracks.marks.append(place)
    if nowhere:
        what = "1 mark was" if nowhere == 1 else f"{nowhere} marks were"
        tracks.notes.append(f"{what} made while the car's position was unknown, and cannot be drawn.")


def _place(car: Track, at_s: float, event: Mapping[str, Any]) -> Place | None:
    """Where the car was then; None: that is not known."""
    index = car.near(at_s)
    if index is None:
        return None
    return Place(at_s=at_s, lat_deg=car.lat_deg[index], lon_deg=car.lon_deg[index], alt_m=car.alt_m[index], event=event)


def _is_place(lat_deg: float, lon_deg: float) -> bool:
    return -90.0 <= lat_deg <= 90.0 and -360.0 <= lon_deg <= 360.0


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if is_number else None
