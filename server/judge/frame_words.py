"""What the words in the name of a frame or topic say of where it points."""

from __future__ import annotations

import re
from functools import lru_cache

# Words of frames whose axes point east and north, or of the antenna of a receiver that gives its velocity in them.
EARTH_WORDS = frozenset(
    {
        "gps", "gnss", "navsat", "navsatfix", "gnssfix", "enu", "ned", "map", "utm", "world", "odom", "earth", "ecef",
        "wgs", "llh", "navigation", "global", "antenna", "ublox", "novatel", "septentrio", "geodetic",
    }
)  # fmt: skip
AHEAD_WORDS = frozenset({"front", "ahead", "forward", "fwd", "bow", "fore"})
ELSEWHERE_WORDS = frozenset({"rear", "back", "backward", "behind", "aft", "left", "right", "side", "tail", "stern"})


@lru_cache(maxsize=1000)
def words(name: str) -> frozenset[str]:
    """The words of a topic or frame in small letters, without the numbers at their ends: "gps0_link": gps, link."""
    split = re.sub(r"([a-z])([A-Z])", r"\1_\2", name[:300])
    return frozenset(
        found.rstrip("0123456789") or found for found in re.split(r"[^A-Za-z0-9]+", split.lower()) if found
    )


@lru_cache(maxsize=1000)
def is_earth_fixed(frame: str) -> bool:
    """Whether a velocity in this frame is given in east and north, by the name of the frame."""
    return not EARTH_WORDS.isdisjoint(words(frame))


def looks(name: str) -> int:
    """-1: a word of the name says ahead, 1: it says elsewhere, 0: neither, or both."""
    found = words(name)
    return found.isdisjoint(AHEAD_WORDS) - found.isdisjoint(ELSEWHERE_WORDS)
