"""The direction of a sensor by the parts of its frame's or topic's name."""

from __future__ import annotations

import re
from functools import lru_cache

# Name parts of frames whose axes point east and north, or of the antenna of a receiver with such a velocity.
EARTH_WORDS = frozenset(
    {
        "gps", "gnss", "navsat", "navsatfix", "gnssfix", "enu", "ned", "map", "utm", "world", "odom", "earth", "ecef",
        "wgs", "llh", "navigation", "global", "antenna", "ublox", "novatel", "septentrio", "geodetic",
    }
)  # fmt: skip
AHEAD_WORDS = frozenset({"front", "ahead", "forward", "fwd", "bow", "fore"})
ELSEWHERE_WORDS = frozenset({"rear", "back", "backward", "behind", "aft", "left", "right", "side", "tail", "stern"})


@lru_cache(maxsize=1000)
def name_parts(name: str) -> frozenset[str]:
    """The parts of a topic or frame name in lower case, without trailing digits: "gps0_link": gps, link."""
    split = re.sub(r"([a-z])([A-Z])", r"\1_\2", name[:300])
    return frozenset(
        found.rstrip("0123456789") or found for found in re.split(r"[^A-Za-z0-9]+", split.lower()) if found
    )


@lru_cache(maxsize=1000)
def is_earth_fixed(frame: str) -> bool:
    """Whether a velocity in this frame is given in east and north, by the name of the frame."""
    return not EARTH_WORDS.isdisjoint(name_parts(frame))


def direction_by_name(name: str) -> int:
    """-1: a part of the name stands for ahead, 1: for elsewhere, 0: neither, or both."""
    found = name_parts(name)
    return found.isdisjoint(AHEAD_WORDS) - found.isdisjoint(ELSEWHERE_WORDS)
