"""What a session answers beyond its state: where the car went, what it publishes besides, why a wish was refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from monitor.runner import Refused
from monitor.signals import SIGNALS
from monitor.state import Snapshot
from server import commands, problems, wire
from server.address import BadAddress
from server.reception import Reception
from server.settings import BadSetting, Conflict

REFUSALS = (commands.NotUnderstood, BadAddress, Refused, BadSetting, Conflict, OSError)  # what `refusal` has words for


def refusal(why: Exception) -> dict[str, Any]:
    """The answer to a wish that cannot be met, one of REFUSALS."""
    match why:
        case BadAddress():
            problem = problems.of_bad_address(why)
            return {
                "ok": False,
                "reason": f"{problem.title} {problem.hint}".strip(),
                "problem": problem.as_json() | {"suggestion": why.suggestion},
            }
        case Refused():
            return {"ok": False, "reason": why.reason}
        case BadSetting():
            return {"ok": False, "reason": str(why), "field": why.field}
        case Conflict():
            return {"ok": False, "reason": str(why), "conflict": True}
        case OSError():
            return {"ok": False, "reason": f"The settings cannot be kept: {why.strerror or why}."}
    return {"ok": False, "reason": str(why)}


def track(snapshot: Snapshot) -> dict[str, Any]:
    """The positions since connecting, thinned, as a GeoJSON LineString (longitude, latitude; WGS84)."""
    points = [[round(p.lon_deg, 7), round(p.lat_deg, 7)] for p in snapshot.track]
    return {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": points},
        "properties": {"length_m": wire.plain(snapshot.track_m, 1)},
    }


def signals(unmapped: Mapping[str, str], reception: Reception) -> dict[str, Any]:
    """Topics beyond the signals, and what came that was no message."""
    return {
        "topics": [{"topic": name, "type": kind} for name, kind in sorted(unmapped.items())],
        "rejected": {
            SIGNALS[name].label: dict(tally.reasons) for name, tally in reception.by_signal.items() if tally.rejected
        },
        "unreadable_frames": dict(reception.frames.reasons),
        "unasked": reception.unasked,
    }
