"""What a car offers, asked of its bridge through rosapi: topics and types, the version of ROS, whether ROS still
lives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from server.link import CallFailed, LinkDown, RosLink
from server.source import RosVersion
from server.topics import ros_version

MAX_TOPICS = 5000


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """What the bridge says there is."""

    topics: Mapping[str, str]  # topic → type as the bridge spells it, "" where it does not say
    ros: RosVersion | None


async def ask_topics(link: RosLink) -> Offer | None:
    """The topics of the car; None where the bridge has no rosapi or does not answer sensibly. Raises LinkDown."""
    try:
        answer = await link.call("/rosapi/topics", timeout_s=2.5)
    except CallFailed:
        return None
    names, types = _lists(answer)
    if names is None:
        return None
    found = dict(zip(names, types + [""] * (len(names) - len(types)), strict=False))
    for name in [name for name, kind in found.items() if not kind][:50]:
        found[name] = await _ask_type(link, name)
    version = ros_version(found)
    return Offer(topics=found, ros=2 if version == 2 else 1 if version == 1 else None)


async def ask_alive(link: RosLink) -> bool | None:
    """Does ROS behind the bridge still answer? None: it never could say (no rosapi). Raises LinkDown."""
    try:
        answer = await link.call("/rosapi/get_time", timeout_s=1.5)
    except CallFailed:
        return False
    return isinstance(answer, Mapping)


async def _ask_type(link: RosLink, topic: str) -> str:
    try:
        answer = await link.call("/rosapi/topic_type", {"topic": topic}, timeout_s=1.5)
    except (CallFailed, LinkDown):
        return ""
    kind = answer.get("type") if isinstance(answer, Mapping) else None
    return kind if isinstance(kind, str) else ""


def _lists(answer: Any) -> tuple[list[str] | None, list[str]]:
    if not isinstance(answer, Mapping):
        return None, []
    names, types = answer.get("topics"), answer.get("types")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None, []
    if not isinstance(types, list) or not all(isinstance(kind, str) for kind in types):
        types = []
    return names[:MAX_TOPICS], types[:MAX_TOPICS]
