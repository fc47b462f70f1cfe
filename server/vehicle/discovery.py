"""Queries to rosapi: topics and types, the ROS version, whether ROS is alive."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from server.judge.message import RosVersion
from server.judge.message_fields import stamp_s
from server.judge.topics import ros_version
from server.recording.read.schemas import text_of_details
from server.rosbridge.live_source import CallFailed, LinkDown
from server.rosbridge.rosapi_client import ServiceCaller

MAX_TOPICS = 5000
MAX_PUBLISHERS = 100
MAX_NAME = 120
BRIDGES = ("rosbridge", "foxglove_bridge")  # in the names of the nodes through which we publish ourselves
MAX_DETAILS = 100  # types fetched one by one
DEFINITIONS_WITHIN_S = 5.0  # rosapi reads a file for each type
_FAILED = "# failed to get full definition text"  # a comment in place of a definition, by ROS 2: not an empty message
STANDARD = frozenset(
    f"{name}_msgs"
    for name in ("std", "geometry", "sensor", "nav", "diagnostic", "rosgraph", "tf2", "visualization", "shape", "map")
) | {"trajectory_msgs", "actionlib_msgs", "builtin_interfaces", "rcl_interfaces"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """The topics and types of the bridge."""

    topics: Mapping[str, str]  # topic → type as the bridge spells it, "" if unknown
    ros: RosVersion | None


async def fetch_topics(link: ServiceCaller) -> Offer | None:
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
        found[name] = await _fetch_type(link, name)
    version = ros_version(found)
    return Offer(topics=found, ros=2 if version == 2 else 1 if version == 1 else None)


async def fetch_definitions(link: ServiceCaller, types: Collection[str], ros: RosVersion | None) -> dict[str, str]:
    """The type definitions known to the bridge, as .msg text. Raises LinkDown, or CallFailed without an answer.

    `message_details` is called on ROS 1 only: on ROS 2 it can end rosapi.
    """
    answer = await link.call("/rosapi/topics_and_raw_types", timeout_s=DEFINITIONS_WITHIN_S)
    found = {type: text for type, text in _texts(answer, ros).items() if type in types}
    for type in sorted(set(types) - found.keys())[:MAX_DETAILS] if ros == 1 else ():
        if plain_package(type) not in STANDARD:  # for these the distribution has more than rosapi returns
            try:
                text = text_of_details(await link.call("/rosapi/message_details", {"type": type}, timeout_s=1.5))
            except CallFailed:
                continue
            if text is not None:
                found[type] = text
    return found


async def fetch_alive(link: ServiceCaller, *, timed: Callable[[float], None] = lambda _: None) -> bool | None:
    """Whether ROS behind the bridge answers; None: unknown, no rosapi. Raises LinkDown. `timed` gets the time of ROS
    [s]."""
    try:
        answer = await link.call("/rosapi/get_time", timeout_s=1.5)
    except CallFailed:
        return False
    ros_s = stamp_s({"header": {"stamp": answer.get("time")}}) if isinstance(answer, Mapping) else None
    if ros_s is not None:
        timed(ros_s)
    return isinstance(answer, Mapping)


async def fetch_publishers(link: ServiceCaller, topic: str, *, and_bridge: bool = False) -> tuple[str, ...] | None:
    """The nodes that publish on a topic; `and_bridge`: with the bridge, thus us; None: unknown. Raises LinkDown."""
    try:
        answer = await link.call("/rosapi/publishers", {"topic": topic}, timeout_s=1.0)
    except CallFailed:
        return None
    names = answer.get("publishers") if isinstance(answer, dict) else None
    if not isinstance(names, list):
        return None
    found = {name for name in names[:MAX_PUBLISHERS] if isinstance(name, str)}
    return tuple(sorted(name[:MAX_NAME] for name in found if and_bridge or not any(own in name for own in BRIDGES)))


async def fetch_subscribers(link: ServiceCaller, topic: str) -> tuple[str, ...] | None:
    """The nodes that subscribe to a topic, including the bridge; None: unknown. Raises LinkDown."""
    try:
        answer = await link.call("/rosapi/subscribers", {"topic": topic}, timeout_s=1.0)
    except CallFailed:
        return None
    names = answer.get("subscribers") if isinstance(answer, dict) else None
    if not isinstance(names, list):
        return None
    return tuple(sorted({name[:MAX_NAME] for name in names[:MAX_PUBLISHERS] if isinstance(name, str)}))


async def _fetch_type(link: ServiceCaller, topic: str) -> str:
    try:
        answer = await link.call("/rosapi/topic_type", {"topic": topic}, timeout_s=1.5)
    except (CallFailed, LinkDown):
        return ""
    kind = answer.get("type") if isinstance(answer, Mapping) else None
    return kind if isinstance(kind, str) else ""


def _texts(answer: Any, ros: RosVersion | None) -> dict[str, str]:
    names, types = _lists(answer)
    texts = answer.get("typedefs_full_text") if names is not None else None
    if not isinstance(texts, list) or len(texts) != len(types):
        return {}
    found = {}
    for type, text in zip(types, texts, strict=True):
        if type and isinstance(text, str) and not text.startswith(_FAILED):
            if text:
                found[type] = text
            elif ros == 2:  # no fields; on ROS 1 an empty text may also mean that the bridge does not know the type
                found[type] = "\n"
    return found


def plain_package(type: str) -> str:
    return type.partition("/")[0]


def _lists(answer: Any) -> tuple[list[str] | None, list[str]]:
    if not isinstance(answer, Mapping):
        return None, []
    names, types = answer.get("topics"), answer.get("types")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None, []
    if not isinstance(types, list) or not all(isinstance(kind, str) for kind in types):
        types = []
    return names[:MAX_TOPICS], types[:MAX_TOPICS]
