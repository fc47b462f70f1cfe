"""Makes recordings as catgraph's recorder writes them, by its own writer, from recordings of others."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

from server.recording.export.raw import raw_messages
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.read import open_recording
from server.recording.read.schemas import Schema

Own = tuple[int, str, Mapping[str, Any]]  # ns since 1970, topic, its fields
TOML = 'profile = "auto"\n\n[limits.speed_limit]\nmax_mps = 3.0\n'


class OurFile:
    """A recording while it is made."""

    def __init__(self, path: Path, *, profile: str = "ros1", vehicle: str = "car", **more: str) -> None:
        about = {"vehicle": vehicle, "session": "s1", "part": "1", "profile": profile, "settings": TOML}
        self._file = PartFile(path, profile=profile, metadata=about | more)

    def write(
        self,
        time_ns: int,
        topic: str,
        type: str,
        definition: str,
        encoding: str,
        data: bytes,
        *,
        is_latched: bool = False,
    ) -> None:
        of = {"ros1": "ros1msg", "cdr": "ros2msg", "json": "jsonschema"}[encoding]
        schema = Schema(name=type, encoding=of, data=definition.encode(), message_encoding=encoding, encode=None)
        more = {"offered_qos_profiles": "- durability: transient_local"} if is_latched else None
        self._file.add(self._file.channel(topic, schema, more), time_ns, data)

    def own(self, time_ns: int, topic: str, what: Mapping[str, Any]) -> None:
        schema = own_schema(cast("Any", topic.rpartition("/")[2]))
        self._file.add(
            self._file.channel(topic, schema), time_ns, json.dumps({"time_ms": time_ns / 1e6} | what).encode()
        )

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> Path:
        return self._file.close(ended="closed", why="")


def as_ours(source: Path, path: Path, own: Iterable[Own] = (), **metadata: str) -> Path:
    """A recording of others, copied message for message into one like ours."""
    with open_recording([source]) as recording:
        made = OurFile(path, profile=f"ros{recording.ros_version}", **metadata)
        waiting = sorted(own, key=lambda one: one[0])
        for raw in raw_messages(recording):
            while waiting and waiting[0][0] <= raw.time_ns:
                made.own(*waiting.pop(0))
            channel = raw.channel
            type = channel.type.replace("/msg/", "/") if channel.encoding == "ros1" else channel.type
            how = channel.encoding
            made.write(
                raw.time_ns, channel.topic, type, channel.definition, how, raw.data, is_latched=channel.is_latched
            )
        for one in waiting:
            made.own(*one)
    return made.close()


def event(n: int, at_ms: int, change: str, alarm: str | None = "speed_limit", **more: Any) -> dict[str, Any]:
    """An event of the log as docs/protocol.md has it."""
    fields = {"n": n, "at_ms": at_ms, "alarm": alarm, "change": change, "text": "", "by": None, "settings_version": 1}
    if alarm is not None:
        fields |= {
            "occurrence": 1,
            "title": "Speed above limit",
            "priority": "critical",
            "place": "dialog",
            "sound": "high",
        }
    return fields | more
