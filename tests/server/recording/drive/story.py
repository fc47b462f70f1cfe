"""A drive whose whole truth is known: two minutes along a straight, with people, a check, modes, marks and alarms."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from server.recording.standing import Stood
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1
from tests.server.recording.export.ours import TOML, Own, as_ours, event

NS = 10**9
BEGIN_MS = BEGIN_S * 1000
LENGTH_S = 120.0
SPEED_MPS = 10.0  # all the time
LOST_S = (60.0, 64.0)  # nothing came
EVIL = '<img src=x onerror="alert(1)"> & \'"</script>'
PHOTO = b"\x89PNG\r\n\x1a\n" + bytes(60)
METRE_DEG = 1 / 111_319.49  # of longitude at the equator


def rows(length_s: float = LENGTH_S, speed_mps: float = SPEED_MPS, from_s: float = 0.0) -> list[Row]:
    """Speed at 20 Hz, positions at 5 Hz due east along the equator, but for 0.1 m: 0, 0 is no place."""
    found: list[Row] = []
    for n in range(round(length_s * 20) + 1):
        at_s = from_s + n / 20
        if LOST_S[0] < at_s < LOST_S[1]:
            continue
        found.append((at_s, "/catvehicle/vel", "geometry_msgs/msg/Twist", {"linear": {"x": speed_mps}}))
        if n % 4 == 0:
            fix = {"status": {"status": 0}, "latitude": 1e-6, "longitude": at_s * speed_mps * METRE_DEG}
            fix["position_covariance_type"], fix["position_covariance"] = 2, [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01]
            found.append((at_s, "/fix", "sensor_msgs/msg/NavSatFix", fix))
    return found


def logged(at_s: float, change: str, alarm: str | None = None, **more: Any) -> Own:
    at_ms = BEGIN_MS + round(at_s * 1000)
    return (BEGIN_S * NS + round(at_s * NS), "/catgraph/alarms", event(at_ms - BEGIN_MS, at_ms, change, alarm, **more))


def standing(*own: Own) -> dict[str, str]:
    """What stands after these events, as the recorder writes it into the metadata of the next part."""
    stood = Stood()
    stood.note_all(event for _, topic, event in own if topic == "/catgraph/alarms")
    return stood.as_metadata()


def mark(at_s: float, id: str, change: str = "mark", *, logged_s: float | None = None, **more: Any) -> Own:
    fields = {"category": None, "words": "", "voice": False, "photo": False, "source": "page", "by": "A. K. (Pixel)"}
    row = {"change": change, "mark": id, "marked_ms": BEGIN_MS + round(at_s * 1000), **fields, **more}
    return (BEGIN_S * NS + round((at_s if logged_s is None else logged_s) * NS), "/catgraph/marks", row)


def check(at_s: float, step: str, **more: Any) -> Own:
    counts = {"done": 0, "failed": 0, "not_applicable": 0, "of": 3}
    return logged(at_s, "departure", check="c1", step=step, **{"by": "A. K. (Pixel)", **counts, **more})


def mode(at_s: float, now: str, before: str) -> Own:
    """Logged a moment after it happened, as it has to be confirmed."""
    moment_ms = BEGIN_MS + round(at_s * 1000)
    return logged(at_s + 0.4, "mode", mode=now, before=before, moment_ms=moment_ms, mode_source="/mode", speed_mps=10.0)


RECURRING = [  # items of the check that have an interval
    {"item": "tyres", "title": "Tyres", "every_days": 3650, "every_km": None, "is_done": True},
    {"item": "hitch", "title": EVIL, "every_days": 30, "every_km": None, "is_done": False},
    {"item": "clock", "title": "Clock", "every_days": 30, "every_km": 1.0, "is_done": True},
]
STORY: Sequence[Own] = (
    logged(0.5, "duty", act="on", person="A. K.", role="operator", by="A. K. (Pixel)"),
    logged(0.6, "control", act="taken", holder="A. K. (Pixel)", page="p1", by="A. K. (Pixel)"),
    check(1.0, "begun"),
    check(2.0, "item", item="tyres", item_title="Tyres", result="done", value="", note="", done=1),
    check(3.0, "item", item="clock", item_title="Clock", result="failed", value="0.84 s", note="", done=1, failed=1),
    check(4.0, "item", item="clock", item_title="Clock", result="done", value="0.02 s", note="set again", done=2),
    check(5.0, "item", item="hitch", item_title="Hitch", result="not_applicable", note=EVIL, done=2, not_applicable=1),
    check(6.0, "signed", hash="7c1e" * 16, done=2, not_applicable=1, recurring=RECURRING),
    mode(10.0, "autonomous", "manual"),
    logged(20.0, "raised", "speed_limit", text="12.5 m/s, limit 11.0 m/s", state="UNACKED", announces=True),
    logged(22.1, "acknowledged", "speed_limit", state="ACKED", by="A. K. (Pixel)", person="A. K.", role="operator"),
    logged(30.0, "cleared", "speed_limit", state="NORMAL"),
    mark(33.33, "m1", logged_s=33.4, category="object", words="crate"),
    mark(33.33, "m1", "mark_changed", logged_s=40.0, category="object", words=EVIL, photo=True),
    mark(35.0, "m2"),
    mark(35.0, "m2", "mark_removed", logged_s=36.0),
    mark(50.0, "m3", logged_s=70.0, category="comfort", voice=True),
    logged(45.0, "raised", "signal_slow.scan", title="Scan slower than expected", priority="warning", state="UNACKED"),
    logged(49.6, "acknowledged", "signal_slow.scan", state="ACKED", by="M. R. (Tablet)"),
    logged(55.0, "control", act="handed_over", holder="M. R. (Tablet)", page="p2", by="A. K. (Pixel)"),
    logged(56.0, "duty", act="off", person="A. K.", role="operator"),
    mode(80.0, "manual", "autonomous"),
    logged(
        80.4,
        "intervention",
        moment_ms=BEGIN_MS + 80_000,
        intervention="i1",
        kind_of="to_manual",
        speed_mps=9.3,
        lat_deg=48.1,
        lon_deg=11.5,
        initiated_by="driver",
        active=["signal_slow.scan"],
        before=[{"at_s": -10.0, "speed_mps": 10.0}, {"at_s": "x", "speed_mps": None}],
    ),
    logged(90.0, "intervention_described", intervention="i1", what=EVIL, category="object late", by="M. R. (Tablet)"),
    logged(95.0, "slow_down", step="ordered", order=1, why="obstacle", ordered_by="M. R. (Tablet)"),
    logged(95.2, "slow_down", step="sent", order=1, why="obstacle"),
    logged(96.4, "slow_down", step="slows", order=1, why="obstacle", text="The car slows: 10.0 to 8.2 m/s."),
    logged(110.0, "slow_down", step="released", order=1, why="obstacle"),
)


def recorded(
    folder: Path,
    own: Sequence[Own] = STORY,
    *,
    name: str = "ours.mcap",
    from_s: float = 0.0,
    length_s: float = LENGTH_S,
    **metadata: str,
) -> Path:
    """A recording of ours with these events in its log, and the settings in force; a later part begins at `from_s`."""
    messages = sorted(rows(length_s, from_s=from_s), key=lambda row: row[0])
    source = write_ros1(folder / f"{name}.bag", Drive(messages=messages))
    begin_ns = BEGIN_S * NS + round(from_s * NS)
    settings = (begin_ns, "/catgraph/settings", {"version": 1, "toml": TOML, "in_force": {}})
    late = [0.02 + n / 1000 for n in range(100) if n < length_s]
    delays = [(begin_ns + n * NS, "/catgraph/delay", {"late_s": s, "delays": {}}) for n, s in enumerate(late)]
    ordered = sorted([settings, *delays, *own], key=lambda one: one[0])
    return as_ours(source, folder / name, ordered, **metadata)


BEFORE = [{"at_s": -n / 2, "speed_mps": 10.0 - n / 10} for n in range(20, -1, -1)]
SECOND = (150.0, 60.0)  # the second part of the drive: after 30 s in which nothing was recorded
LATER: Sequence[Own] = (
    logged(150.5, "acknowledged", "gps_drift", by="M. R. (Tablet)", state="ACKED"),
    mode(170.0, "manual", "autonomous"),
    logged(170.0, "intervention", intervention="i2", kind_of="to_manual", speed_mps=10.0, active=[], before=BEFORE),
    logged(175.0, "intervention_described", intervention="i1", what="described later", by="A. K. (Pixel)"),
    mark(180.0, "m9", words="in the second part"),
    logged(190.0, "raised", "speed_limit", text="12.0 m/s", state="UNACKED"),
)


def in_two_parts(folder: Path, *, session: str = "s1") -> list[Path]:
    """A drive of two recordings, the second after a lost link."""
    ordered = logged(117.0, "slow_down", step="ordered", order=2, why="obstacle", ordered_by="M. R. (Tablet)")
    raised = logged(118.0, "raised", "gps_drift", text="0.4 m", state="UNACKED")
    own = [*STORY, ordered, raised]
    first = recorded(folder, own, name=f"{session}.mcap", session=session)
    from_s, length_s = SECOND
    _, alarms, changed = mode(140.0, "autonomous", "manual")  # written as soon as the second part begins
    early = (BEGIN_S * NS + round(from_s * NS), alarms, changed)
    more = {"session": session, "part": "2", **standing(*own)}
    return [
        first,
        recorded(folder, [early, *LATER], name=f"{session}_p2.mcap", from_s=from_s, length_s=length_s, **more),
    ]
