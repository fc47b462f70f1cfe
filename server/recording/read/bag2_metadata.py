"""Read what the `metadata.yaml` of a ROS 2 bag states of its files, within bounds: it may come from anywhere.

The files themselves state what they hold. Counts and times of the metadata are those of a recorder that ended well, and
are not used.

The quality of service of a topic is read as every version of rosbag2 writes it. Sources: `offered_qos_profiles` is YAML
text up to metadata version 8 and a list from 9 on; policies are the numbers of `rmw_qos_durability_policy_t`
(rmw/types.h) or, from version 9 on, their names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

from server.recording.read.errors import RecordingUnreadable

NAME = "metadata.yaml"
MOST_METADATA = 2 << 20  # bytes: a thousand topics
DEEPEST = 30
MOST_ENTRIES = 100_000

MOST_QOS = 64 << 10  # letters, of one topic
_TRANSIENT_LOCAL = ("1", "transient_local")


@dataclass(frozen=True, slots=True, kw_only=True)
class BagMetadata:
    """What a bag states of its files."""

    files: tuple[str, ...]  # their names in the folder
    distro: str | None
    qos: Mapping[str, Any]  # topic → the quality of service offered, as it stands there


def read_metadata(folder: Path) -> BagMetadata:
    """Raises RecordingUnreadable, naming the file, where it is not what a recorder of ROS 2 writes, and where the bag
    is compressed in a way that is not supported; OSError."""
    path = folder / NAME
    if path.stat().st_size > MOST_METADATA:
        raise RecordingUnreadable(f"{path} cannot be read: it is larger than {MOST_METADATA >> 20} MB")
    text = path.read_text(encoding="utf-8", errors="replace")
    if why := why_not_plain(text):
        raise RecordingUnreadable(f"{path} cannot be read: {why}")
    try:
        about = YAML(typ="safe", pure=True).load(text)["rosbag2_bagfile_information"]
        files = [re.split(r"[\\/]", name)[-1] for name in about["relative_file_paths"]]
    except Exception:  # the parser, and what is no such list, fail in every way there is
        raise RecordingUnreadable(
            f"{folder} is damaged or not complete: its {NAME} does not name the files of a bag"
        ) from None
    packed = about.get("compression_mode") or "none", about.get("compression_format") or "none"
    if str(packed[0]).lower() != "none" and str(packed[1]).lower() != "zstd":
        raise RecordingUnreadable(f"{folder} cannot be read: it is compressed as {str(packed[1])[:20]!r}")
    distro = about.get("ros_distro")
    return BagMetadata(
        files=tuple(dict.fromkeys(files)), distro=distro if isinstance(distro, str) else None, qos=dict(_qos(about))
    )


def _qos(about: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    topics = about.get("topics_with_message_count")
    for entry in topics if isinstance(topics, list) else ():
        topic = entry.get("topic_metadata") if isinstance(entry, dict) else None
        if isinstance(topic, dict) and isinstance(topic.get("name"), str):
            yield topic["name"], topic.get("offered_qos_profiles")


@lru_cache(maxsize=64)  # topics have a few kinds of quality of service, which are checked here too
def why_not_plain(text: str) -> str | None:
    """Why YAML is not short, flat and without references; None: it is, or is not YAML."""
    depth = 0
    try:
        for count, event in enumerate(YAML(typ="safe", pure=True).parse(text)):
            if isinstance(event, AliasEvent):
                return "it refers to parts of itself"
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            if depth > DEEPEST:
                return "it is nested too deeply"
            if count > MOST_ENTRIES:
                return f"it has more than {MOST_ENTRIES} entries"
    except RecursionError:
        return "it is nested too deeply"
    except (YAMLError, ValueError):
        return None
    return None


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
