"""The quality of service with which a topic was recorded, as every version of rosbag2 writes it.

Sources: rosbag2's `offered_qos_profiles` is YAML text up to metadata version 8 and a list from 9 on; policies are the
numbers of `rmw_qos_durability_policy_t` (rmw/types.h) or, from version 9 on, their names.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ruamel.yaml import YAML

from server.recording.read.bag2_metadata import why_not_plain

MOST_QOS = 64 << 10  # letters, of one topic
_TRANSIENT_LOCAL = ("1", "transient_local")


def is_latched(offered: Any) -> bool:
    """Whether a publisher kept its last message for late subscribers. What cannot be understood is not known: False."""
    if isinstance(offered, str):
        return _is_latched_text(offered)
    profiles = [offered] if isinstance(offered, dict) else offered if isinstance(offered, list) else []
    return any(isinstance(one, dict) and str(one.get("durability")).lower() in _TRANSIENT_LOCAL for one in profiles)


@lru_cache(maxsize=64)  # topics have a few kinds of quality of service
def _is_latched_text(text: str) -> bool:
    if not text.strip() or len(text) > MOST_QOS or why_not_plain(text) is not None:
        return False
    try:
        found = YAML(typ="safe", pure=True).load(text)
    except Exception:  # the parser raises many exception types on what is not YAML
        return False
    return not isinstance(found, str) and is_latched(found)
