"""When a whole file is sent: a table of rules and the place where the car is. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

from geographiclib.geodesic import Geodesic

from server.recording.export.clip import AFTER_S, BEFORE_S

STANDS_MPS = 0.3  # slower is standing
CLIP_PRIORITIES = ("critical", "warning")  # of the alarms around which a clip is sent
MOST_CLIPS = 10  # of one recording; the first ones of the highest priority
INTERFACES = Path("/sys/class/net")


class WholeFiles(IntEnum):
    """The setting `store.whole_files`."""

    NEVER = 0
    ON_REQUEST = 1
    ALWAYS = 2
    IN_DEPOT = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreRule:
    """The settings of one car, as they are in force."""

    whole: WholeFiles = WholeFiles.ON_REQUEST
    clips: bool = True
    deletes: bool = False  # on the car, after the copy was verified
    bytes_per_s: float = 1e6
    lat_deg: float = 0.0
    lon_deg: float = 0.0
    radius_m: float = 0.0  # 0: no depot is set


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a car is now. What is old is not known, and so None."""

    lat_deg: float | None = None
    lon_deg: float | None = None
    speed_mps: float | None = None


NOWHERE = Place()


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """All that decides for one car."""

    rule: StoreRule = StoreRule()
    place: Place = NOWHERE


def rule_of(limits: Any) -> StoreRule:
    """Of the group `store` of the settings."""
    return StoreRule(
        whole=WholeFiles(round(limits.whole_files)),
        clips=limits.clips >= 1,
        deletes=limits.delete_stored >= 1,
        bytes_per_s=limits.rate_mb_s * 1e6,
        lat_deg=limits.depot_lat_deg,
        lon_deg=limits.depot_lon_deg,
        radius_m=limits.depot_radius_m,
    )


def is_in_depot(rule: StoreRule, place: Place, *, is_on_depot_network: bool) -> bool:
    """The car stands within the circle, or is on the network of the depot. What is not known is no."""
    if is_on_depot_network:
        return True
    if rule.radius_m <= 0 or place.lat_deg is None or place.lon_deg is None or place.speed_mps is None:
        return False
    way = Geodesic.WGS84.Inverse(rule.lat_deg, rule.lon_deg, place.lat_deg, place.lon_deg, Geodesic.DISTANCE)
    return abs(place.speed_mps) < STANDS_MPS and way["s12"] <= rule.radius_m


def why_not_whole(situation: Situation, *, is_asked: bool, is_on_depot_network: bool) -> str | None:
    """Why a whole file is not sent now, as a sentence; None: it is sent."""
    match situation.rule.whole:
        case WholeFiles.NEVER:
            return "Whole files are not uploaded: see Settings, Store."
        case _ if is_asked:
            return None
        case WholeFiles.ALWAYS:
            return None
        case WholeFiles.IN_DEPOT:
            if is_in_depot(situation.rule, situation.place, is_on_depot_network=is_on_depot_network):
                return None
            return "The whole file is uploaded in the depot."
        case _:
            return "The whole file is uploaded on request."


def is_interface_up(name: str | None, root: Path = INTERFACES) -> bool:
    """Whether a network interface of this machine is connected; None: no interface is meant."""
    if name is None:
        return False
    try:
        return (root / name / "operstate").read_text(encoding="ascii").strip() == "up"
    except (OSError, ValueError):
        return False


def moments_of(raised: Iterable[dict[str, Any]]) -> list[int]:
    """The moments of a recording that clips are made around, ms since 1970, oldest first.

    An alarm within the clip of the one before has none of its own.
    """
    known = [alarm for alarm in raised if alarm.get("priority") in CLIP_PRIORITIES]
    chosen: list[int] = []
    for alarm in sorted(known, key=lambda alarm: (CLIP_PRIORITIES.index(alarm["priority"]), alarm["at_ms"])):
        at_ms = int(alarm["at_ms"])
        if len(chosen) < MOST_CLIPS and all(not -BEFORE_S <= (at_ms - one) / 1000 <= AFTER_S for one in chosen):
            chosen.append(at_ms)
    return sorted(chosen)
