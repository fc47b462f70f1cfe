"""The speeds that the sources of a car show, beside the one that is displayed, and which of them contradict it."""

from __future__ import annotations

from typing import NamedTuple

from monitor.compared import Other
from monitor.pace import WINDOW_S, Pace
from monitor.reading import Reading
from monitor.snapshot import Snapshot

LATENCY_S = 1.0  # a source may be so much later than another
POOR_MPS = 5.0  # an error beyond this proves nothing
# A position that drifts at standstill, slower than this, is a matter of "GPS drift"; the highest limit in Settings.
DRIFT_MPS = 3.0
HALF = 0.5  # the highest relative limit in Settings
GAINING_MPS = 0.5  # faster than on average over the last 3 s
REPEATS = 3  # messages with one place


class Shown(NamedTuple):
    """The speed by one source. A tuple, because several are made with each tick."""

    by: str  # as text: a topic, "GPS", "the poses of /odom"
    pace: Pace | None  # None: not known
    why_not: str = ""  # why it proves nothing, as text
    short: str = ""  # the same in at most 8 letters


def own(snapshot: Snapshot) -> Shown:
    """The displayed speed."""
    topic = snapshot.link.carriers.get("speed")
    pace = snapshot.compared.stated.get("speed")
    return Shown(by="" if topic is None else f" by {topic}", pace=pace)


def others(snapshot: Snapshot) -> list[Shown]:
    """What else shows a speed, the positions first. Of the topic of the speed only its poses are a source of their
    own."""
    found: list[Shown] = []
    carriers, compared = snapshot.link.carriers, snapshot.compared
    speed_topic = carriers.get("speed")
    if (fix := snapshot.get("position")) is not None and _is_apart("position", snapshot):
        why = "GPS has no fix" if fix.value.status < 0 else ""
        found.append(_judged("GPS", fix, compared.made.get("position"), snapshot, why=why, short="no fix"))
    for one in _beside("position", snapshot):
        why = f"{one.topic} has no fix" if one.reading.value.status < 0 else ""
        found.append(_judged(f"GPS {one.topic}", one.reading, one.made, snapshot, why=why, short="no fix"))
    if (odometry := snapshot.get("odometry")) is not None:
        topic = carriers.get("odometry")
        if topic is not None and speed_topic is not None:
            found += _by_odometry(
                topic, odometry, compared.stated.get("odometry"), compared.made.get("odometry"), snapshot
            )
    for one in _beside("odometry", snapshot):
        found += _by_odometry(one.topic, one.reading, one.stated, one.made, snapshot)
    for one in _beside("speed", snapshot):
        found += _live(one.topic, one.reading, one.stated, snapshot)
    for signal in ("position", "odometry", "speed"):
        for name in compared.awaited.get(signal, ()):
            found.append(Shown(name, None, f"No message from {name} yet", "not sent"))
    return found


def _is_apart(signal: str, snapshot: Snapshot) -> bool:
    """Whether a signal comes on another topic than the speed."""
    topic = snapshot.link.carriers.get(signal)
    return topic is None or topic != snapshot.link.carriers.get("speed")


def _beside(signal: str, snapshot: Snapshot) -> list[Other]:
    """The further sources of a signal, those left out that carry it now or carry the speed; of an odometry that does,
    the poses are another source."""
    if not snapshot.compared.others:
        return []
    carriers = snapshot.link.carriers
    taken = {carriers.get(signal), None if signal == "odometry" else carriers.get("speed")}
    return [one for one in snapshot.compared.of(signal) if one.topic not in taken]


def _by_odometry(
    topic: str, reading: Reading[object], stated: Pace | None, made: Pace | None, snapshot: Snapshot
) -> list[Shown]:
    poses = _live(f"the poses of {topic}", reading, made, snapshot)
    if topic == snapshot.link.carriers.get("speed"):
        return poses
    return [*_live(topic, reading, stated, snapshot), *poses]


def _live(by: str, reading: Reading[object], pace: Pace | None, snapshot: Snapshot) -> list[Shown]:
    """A speed that was never anything but 0, or a pose that never moved, may be one that its driver does not fill."""
    if pace is not None and not pace.is_live:
        return []
    return [_judged(by, reading, pace, snapshot)]


def _judged(
    by: str, reading: Reading[object], pace: Pace | None, snapshot: Snapshot, *, why: str = "", short: str = ""
) -> Shown:
    if not reading.is_fresh(snapshot.now_s):
        return Shown(by, None, f"{by} is {reading.age_s(snapshot.now_s):.0f} s old", "stale")
    if why:
        return Shown(by, None, why, short)
    if pace is None:
        return Shown(by, None, f"Waiting for {WINDOW_S:.0f} s of {by}", "waiting")
    if pace.error_mps > POOR_MPS:
        return Shown(by, None, f"{by} is too poor: its error may make {pace.error_mps:.0f} m/s", "too poor")
    repeats = reading.repeats
    if repeats is not None and repeats.value_n >= REPEATS and repeats.value_s > 0.0:
        return Shown(by, None, f"{by} repeats one value", "frozen")
    return Shown(by, pace)


def allowed_mps(a: Pace, b: Pace, *, least_mps: float, share: float) -> float:
    """How far apart [m/s] two sources of one speed may be: by the limits, their errors and their latency."""
    latency_mps = LATENCY_S / WINDOW_S * max(a.changed_mps, b.changed_mps)
    return max(least_mps, share * max(a.mps, b.mps)) + a.error_mps + b.error_mps + latency_mps


def is_in_dispute(snapshot: Snapshot, over_ground_mps: float, speed_mps: float) -> bool:
    """Whether the position moves as a car does, and so much faster than the wheels that their comparison will fail
    whatever its limits; or is about to, because it still gains speed."""
    made = snapshot.compared.made.get("position")
    if made is None or made.error_mps > POOR_MPS or not (snapshot.gps.is_smooth and _is_apart("position", snapshot)):
        return False
    beyond_mps = max(DRIFT_MPS, HALF * over_ground_mps) + made.error_mps
    return over_ground_mps - speed_mps > beyond_mps or over_ground_mps > made.mps + GAINING_MPS
