"""Small recordings of our own kind: a way driven, alarms on it, and what else a drive leaves behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import orjson

from server.recording.folder import RecordingsFolder
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.schemas import Schema, TypeBook
from server.recording.recover import Recovered, recover

BEGAN_MS = 1_790_000_000_000
NORTH_M = 111_000.0  # of one degree of latitude, near enough
Alarm = tuple[float, str]  # seconds since the beginning, priority


@cache
def _known(type: str) -> Schema:
    found = TypeBook(1).schema(type)
    assert found is not None
    assert found.encode is not None
    return found


def record(
    path: Path,
    *,
    seconds: float = 20.0,
    speed_mps: float = 5.0,
    alarms: Sequence[Alarm] = (),
    began_ms: int = BEGAN_MS,
    at: tuple[float, float] | None = (32.2319, -110.9501),
    bend_deg: float = 3.0,
    is_closed: bool = True,
    own: Sequence[dict[str, Any]] = (),
    **metadata: str,
) -> Path:
    """A drive at a steady speed, north at first and then ever more to the right; `at` None: without a position. `own`:
    more events of its log, at its beginning."""
    fields = {"vehicle": path.parent.name, "session": "5e55", "part": "1", "started_ms": str(began_ms)} | metadata
    file = PartFile(path, profile="ros1", metadata=fields)
    fix, vel = _known("sensor_msgs/NavSatFix"), _known("geometry_msgs/Twist")
    east_m = north_m = heading = 0.0
    events = list(alarms)
    for event in own:
        _event(file, began_ms * 1_000_000, event)
    for n in range(round(seconds * 10) + 1):
        at_ns = began_ms * 1_000_000 + n * 100_000_000
        heading += math.radians(bend_deg) / 10
        east_m += speed_mps / 10 * math.sin(heading)
        north_m += speed_mps / 10 * math.cos(heading)
        assert vel.encode
        assert fix.encode
        zero = {"x": 0.0, "y": 0.0, "z": 0.0}
        twist = {"linear": zero | {"x": speed_mps}, "angular": zero}
        file.add(file.channel("/catvehicle/vel", vel), at_ns, vel.encode(twist))
        if at is not None and n % 2 == 0:
            lat = at[0] + north_m / NORTH_M
            lon = math.remainder(at[1] + east_m / NORTH_M / math.cos(math.radians(at[0])), 360.0)
            file.add(file.channel("/gps_fix", fix), at_ns, fix.encode(_fix(lat, lon, n)))
        while events and events[0][0] <= n / 10:
            _, priority = events.pop(0)
            _event(file, at_ns, raised(n, priority, at_ns))
            _event(file, at_ns, raised(n, priority, at_ns) | {"change": "cleared"})
        if n % 10 == 9:
            file.flush()
    file.flush()
    if not is_closed:
        file.abandon()
        return path
    return file.close(ended=metadata.get("ended", "closed"))


def raised(n: int, priority: str, at_ns: int) -> dict[str, Any]:
    """An event of the log as docs/protocol.md has it."""
    return {
        "n": n + 1, "at_ms": at_ns // 1_000_000, "time_ms": at_ns / 1e6, "alarm": f"an_{priority}", "occurrence": n,
        "change": "raised", "title": f"A {priority} alarm", "priority": priority, "text": "12.6 m/s, limit 11.0 m/s",
        "by": None,
    }  # fmt: skip


def _event(file: PartFile, at_ns: int, event: dict[str, Any]) -> None:
    file.add(file.channel("/catgraph/alarms", own_schema("alarms")), at_ns, orjson.dumps(event))


def _fix(lat_deg: float, lon_deg: float, n: int) -> dict[str, Any]:
    return {
        "header": {"seq": n, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "gps"},
        "status": {"status": 0, "service": 1},
        "latitude": lat_deg, "longitude": lon_deg, "altitude": 700.0,
        "position_covariance": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0], "position_covariance_type": 2,
    }  # fmt: skip


def recover_all(folder: RecordingsFolder) -> list[Recovered]:
    """Recovers all that a server left."""
    return [recover(left) for left in folder.unfinished()]
