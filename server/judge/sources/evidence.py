"""What the messages of candidate topics show of them: frames, velocities, poses, and whether they agree. Pure.

`gather` reads parts of a recording for it, before the recording is judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, Protocol

from monitor.values import LaserScan
from server.judge.message import Json
from server.judge.message_fields import Rejected, inner, number, stamp_s, text
from server.judge.signals.scan import laser_scan
from server.judge.signals.speed import SIDEWAYS
from server.judge.sources.motion import (
    FIX_MPS,
    GAP_S,
    MOVES_MPS,
    course_rad,
    east_north_m,
    is_same,
    least_way_m,
    metres_between,
    turned,
)
from server.judge.sources.source import plain_type
from server.judge.sources.topic_evidence import FIXES_S, ODOMETRY, TopicEvidence, picture_of, see_the_same

MOST_TOPICS = 64
SAME_TIME_S = 0.3  # two messages so near in time are compared
PICTURE_EVERY_S = 0.4
AGREE_ENOUGH = 10
NO_REVERSE_MPS = 4.0  # faster than a car is reversed for long
COURSE_WITHIN_RAD = math.radians(20)
COURSE_CLEAR_RAD = math.radians(40)  # so far from east a velocity along the car differs from one in east and north
SAME_PLACE_M = 5.0


Place = Callable[[str, LaserScan], bool | None]
NOTHING = TopicEvidence(kind="")


class Evidence:
    """Of the candidate topics of one car, or of one recording. Times are of one clock that does not go back, in s.

    `place`: whether the laser of a topic, by one of its scans, looks ahead of the car; None: not known.
    """

    def __init__(self, place: Place | None = None) -> None:
        self._topics: dict[str, TopicEvidence] = {}
        self._same: dict[tuple[str, str], list[int]] = {}  # pair of topics → how often alike, how often not
        self.place: Place = place or (lambda *_: None)
        self.is_of_one_car: Callable[[str, str], bool] = lambda *_: True  # of two topics
        self.silent: frozenset[str] = frozenset()  # topics without a message in the whole recording
        self.is_settled = True  # False: candidates have only just been subscribed to

    def follow(self, topics: Mapping[str, str], *, is_beside: bool = False) -> None:
        """Further topics (topic → type) whose messages count; what is known of the others is kept. `is_beside`: they
        only show whether the car moves, and whether they are filled."""
        for topic, kind in topics.items():
            known = self._topics.get(topic)
            if known is not None:
                known.is_beside &= is_beside
            elif len(self._topics) < MOST_TOPICS:
                self._topics[topic] = TopicEvidence(kind=plain_type(kind), is_beside=is_beside)

    @property
    def followed(self) -> frozenset[str]:
        """The topics whose messages count."""
        return frozenset(self._topics)

    @property
    def is_to_gather(self) -> bool:
        """Whether a message could decide anything."""
        return any(not known.is_beside or known.kind != "sensor_msgs/NavSatFix" for known in self._topics.values())

    def of(self, topic: str) -> TopicEvidence:
        """What is known of a topic."""
        return self._topics.get(topic, NOTHING)

    def agree(self, one: str, other: str) -> bool | None:
        """Whether the values of two topics are alike; None: not known."""
        alike, unlike = self._same.get((min(one, other), max(one, other)), (0, 0))
        if alike >= AGREE_ENOUGH and alike >= 5 * unlike:
            return True
        return False if unlike >= AGREE_ENOUGH and unlike > alike else None

    @property
    def is_enough(self) -> bool:
        """Whether more messages would hardly show more."""
        return all(known.is_enough for known in self._topics.values()) and self._is_compared()

    def _is_compared(self) -> bool:
        """Whether topics of one kind, where there are several, are known to be alike or not."""
        for kind in ("nav_msgs/Odometry", "sensor_msgs/NavSatFix", "sensor_msgs/LaserScan"):
            names = [
                name
                for name, known in self._topics.items()
                if known.kind == kind and not known.is_twist_empty and not known.is_beside
            ]
            for other in names[1:]:
                is_other_laser = kind == "sensor_msgs/LaserScan" and self.of(names[0]).frame != self.of(other).frame
                if not is_other_laser and self.agree(names[0], other) is None:
                    return False
        return True

    def receive(self, topic: str, message: Any, at_s: float) -> bool:
        """Takes a message of any topic; whether it changed what a choice may depend on."""
        known = self._topics.get(topic)
        if known is None:
            return False
        before = known.shown
        known.count += 1
        if known.frame is None and isinstance(message, Mapping):
            known.frame = text(message, "header", "frame_id")[:100] or None
        try:
            agreed = self._take(topic, known, message, at_s)
        except (Rejected, AttributeError, KeyError, TypeError, ValueError, OverflowError):
            agreed = False  # a message that is not proper shows nothing
        return agreed or known.shown != before

    def _take(self, topic: str, known: TopicEvidence, message: Any, at_s: float) -> bool:
        match known.kind:
            case "nav_msgs/Odometry":
                x, y = self._twist(known, inner(inner(message, "twist"), "twist"), at_s)
                known.pose(inner(message, "pose"), at_s)
                self._note_zero(topic, known, at_s)
                return self._compare_speeds(topic, math.hypot(x, y), at_s)
            case "geometry_msgs/TwistStamped" | "geometry_msgs/Twist":
                body = inner(message, "twist") if known.kind.endswith("Stamped") else message
                x, y = self._twist(known, body, at_s)
                self._note_zero(topic, known, at_s)
                self._vote(known, x, y, at_s)
            case "std_msgs/Float32" | "std_msgs/Float64":
                speed = number(message, "data")
                known.has_twist |= speed != 0.0
                known.stated.state(speed, at_s)
                self._note_zero(topic, known, at_s)
            case "sensor_msgs/NavSatFix":
                return self._fix(topic, known, message, at_s)
            case "sensor_msgs/LaserScan":
                return self._scan(topic, known, message, at_s)
        return False

    def _twist(self, known: TopicEvidence, twist: Any, at_s: float) -> tuple[float, float]:
        x, y = number(twist, "linear", "x"), number(twist, "linear", "y")
        known.has_twist |= x != 0.0 or y != 0.0  # NaN too: it is filled, as unknown
        known.velocity = (at_s, x, 0.0 if math.isnan(y) else y)
        known.is_filled |= math.hypot(x, known.velocity[2]) > 0.0
        known.stated.state(math.hypot(x, known.velocity[2]), at_s)
        return x, known.velocity[2]

    def _note_zero(self, topic: str, known: TopicEvidence, at_s: float) -> None:
        """Whether a speed that was never anything but zero is so while others show that the car moves."""
        if known.has_twist or ODOMETRY in known.idle_beside:
            return
        before = known.zero_s
        since_s, last_s = before if before is not None else (at_s, at_s)
        known.zero_s = (since_s if 0.0 <= at_s - last_s <= GAP_S else at_s, at_s)
        for name, other in self._topics.items():
            proof = other.moves_since(known.zero_s[0], at_s)
            if name == topic or proof is None or proof in known.idle_beside:
                continue
            # A pose that rests contradicts a velocity.
            is_proof = other.kind in (ODOMETRY, "sensor_msgs/NavSatFix") or known.kind != ODOMETRY
            if is_proof and self.is_of_one_car(topic, name):
                known.idle_beside[proof] = name

    def _vote(self, known: TopicEvidence, x: float, y: float, at_s: float) -> None:
        """Whether one velocity is along the car or in east and north."""
        way = math.hypot(x, y)
        if not way > MOVES_MPS:
            return
        if abs(y) > SIDEWAYS * way:
            known.earth_votes += 1
            return
        for other in self._near(at_s, SAME_TIME_S):
            if other.kind == "nav_msgs/Odometry" and other.has_twist and other.velocity is not None:
                body = math.hypot(*other.velocity[1:])
                if is_same(way, body):
                    # Reversing is beyond doubt only where the odometry reverses too, and hardly aside.
                    reverses = other.velocity[1] < 0 and abs(other.velocity[2]) <= SIDEWAYS * body
                    known.body_votes += (x < 0) == reverses
                    known.earth_votes += (x < 0) != reverses
                    return
        course = next((t.course for t in self._topics.values() if t.course and at_s - t.course[0] <= FIXES_S), None)
        if course is None or abs(turned(course[1], 0.0)) < COURSE_CLEAR_RAD:
            return
        if abs(turned(math.atan2(y, x), course[1])) < COURSE_WITHIN_RAD and (x > 0 or way > NO_REVERSE_MPS):
            known.earth_votes += 1
        elif x > 0:
            known.body_votes += 1

    def _compare_speeds(self, topic: str, speed_mps: float, at_s: float) -> bool:
        changed = False
        for name, other in self._topics.items():
            if name != topic and other.kind == "nav_msgs/Odometry" and other.velocity is not None:
                if at_s - other.velocity[0] <= SAME_TIME_S:
                    beside = math.hypot(*other.velocity[1:])
                    if max(speed_mps, beside) > MOVES_MPS:
                        changed |= self._note(topic, name, is_alike=is_same(speed_mps, beside))
        return changed

    def _fix(self, topic: str, known: TopicEvidence, message: Any, at_s: float) -> bool:
        if number(message, "status", "status") < 0:
            return False
        latitude, longitude = number(message, "latitude"), number(message, "longitude")
        if not (abs(latitude) <= 90 and abs(longitude) <= 360) or (latitude == 0.0 and longitude == 0.0):
            return False
        known.origin = known.origin or (latitude, longitude)
        known.least_m = least_way_m(message.get("position_covariance"))
        known.made.place(*east_north_m(known.origin, (latitude, longitude)), at_s, slowest_mps=FIX_MPS)
        before, known.place = known.place, (at_s, latitude, longitude)
        if before is not None and 0.0 < at_s - before[0] <= 2 * FIXES_S:
            way_m = metres_between(before[1:], known.place[1:])
            is_moving = way_m > max(0.2, 2.0 * (at_s - before[0]))
            known.course = (at_s, course_rad(before[1:], known.place[1:])) if is_moving else None
        changed = False
        for name, other in self._topics.items():
            if name != topic and other.place is not None and at_s - other.place[0] <= FIXES_S:
                is_alike = metres_between(other.place[1:], known.place[1:]) <= SAME_PLACE_M
                changed |= self._note(topic, name, is_alike=is_alike)
        return changed

    def _scan(self, topic: str, known: TopicEvidence, message: Any, at_s: float) -> bool:
        stamp = stamp_s(message)
        is_of_another = stamp is not None and any(
            other.picture is not None and other.picture.stamp_s == stamp
            for name, other in self._topics.items()
            if name != topic
        )
        if known.picture is not None and 0.0 <= at_s - known.picture.at_s < PICTURE_EVERY_S and not is_of_another:
            return False
        scan = laser_scan(message)
        known.picture, known.looks_ahead = picture_of(scan, stamp, at_s), self.place(topic, scan)
        changed = False
        for name, other in self._topics.items():
            if name != topic and other.picture is not None and known.picture is not None:
                if other.frame == known.frame:
                    is_alike = see_the_same(known.picture, other.picture)
                    changed |= is_alike is not None and self._note(topic, name, is_alike=is_alike)
        return changed

    def _note(self, one: str, other: str, *, is_alike: bool) -> bool:
        """Counts a comparison; whether the answer of `agree` is another now."""
        before = self.agree(one, other)
        counts = self._same.setdefault((min(one, other), max(one, other)), [0, 0])
        if before is None or counts[not is_alike] < 10 * AGREE_ENOUGH:
            counts[not is_alike] += 1
        return self.agree(one, other) is not before

    def _near(self, at_s: float, within_s: float) -> Iterable[TopicEvidence]:
        return (t for t in self._topics.values() if t.velocity is not None and at_s - t.velocity[0] <= within_s)


# Where it reads, as parts of the length: a car may stand still at the beginning, for minutes.
PLACES = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
WINDOW_S = 15.0
MOST_ROWS = 6000  # of all topics, in one place
MOST_TAKEN = 1000  # of the topics that compete, in one place


Row = tuple[float, str, str, Json]


class Rows(Protocol):
    """Messages with their times, as `server.judge.drive.MessageSource`."""

    start_s: float
    duration_s: float

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]: ...


def gather(source: Rows, names: Mapping[str, str], evidence: Evidence) -> Evidence:
    """Lets the messages of the topics that the evidence follows count, until they are enough.

    `names`: topic as the recording spells it → as a bridge would.
    """
    followed = evidence.followed
    wanted = frozenset(name for name, offered in names.items() if offered in followed)
    rejected: dict[str, int] = getattr(source, "rejected", {})
    before = dict(rejected)
    for part in PLACES:
        if part and source.duration_s * part < WINDOW_S:
            continue
        if _read_window(source, source.duration_s * part, names, wanted, evidence):
            break
    rejected.clear()
    rejected.update(before)
    return evidence


def _read_window(
    source: Rows, at_s: float, names: Mapping[str, str], wanted: frozenset[str], evidence: Evidence
) -> bool:
    """Reads on from one place for a while; whether all is known."""
    end_s = source.start_s + at_s + WINDOW_S
    taken = 0
    for row_s, topic, _, message in islice(_rows_until_damage(source, at_s, wanted), MOST_ROWS):
        if row_s > end_s or taken >= MOST_TAKEN:
            break
        if topic in wanted:
            taken += 1
            if evidence.receive(names[topic], message, row_s) and evidence.is_enough:
                return True
    return evidence.is_enough


def _rows_until_damage(source: Rows, at_s: float, wanted: frozenset[str]) -> Iterator[Row]:
    """Messages up to the first unreadable one; the run that judges the recording reports the error."""
    rows = source.rows(at_s, wanted)
    while True:
        try:
            row = next(rows, None)
        except MemoryError:
            raise
        except Exception:  # readers of damaged files fail in every way there is
            return
        if row is None:
            return
        yield row
