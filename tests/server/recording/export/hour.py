"""A long drive of the simulated car, driven fast and written by the recorder's own writer: python -m … OUT SECONDS."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson

from server.judge.message import Message, RosVersion
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.schemas import TypeBook
from server.simulator.car import START_S, SimulatedCar
from tests.server.recording.export.ours import TOML, event


def drive(path: Path, seconds: float, version: RosVersion = 1, *, lap_s: float = math.inf) -> Path:
    """Writes the recording: every message of the car, an alarm and its acknowledgement each minute, a phone each
    second. After `lap_s` the same comes again, which is quicker made."""
    book = TypeBook(version)
    file = PartFile(path, profile=f"ros{version}", metadata={"vehicle": "car", "session": "1h", "settings": TOML})

    def own(at_ns: int, channel: Any, what: dict[str, Any]) -> None:
        number = file.channel(f"/catgraph/{channel}", own_schema(channel))
        file.add(number, at_ns, orjson.dumps({"time_ms": at_ns / 1e6} | what))

    second = 0
    for at_s, message in _messages(seconds, version, lap_s):
        at_ns = round((START_S + at_s) * 1e9)
        schema = book.schema(message.type)
        assert schema is not None
        assert schema.encode is not None
        file.add(file.channel(message.topic, schema), at_ns, schema.encode(message.message))
        if int(at_s) > second:
            second = int(at_s)
            file.flush()
            fix = {"lat_deg": 32.2, "lon_deg": -110.9 + second * 1e-6, "accuracy_m": 5.0, "age_s": 0.1}
            own(at_ns, "phone", {"phone": "9c", "why": None, "fix": fix})
            if second % 60 == 30:
                own(at_ns, "alarms", event(second, at_ns // 1_000_000, "raised", state="UNACKED", announces=True))
            if second % 60 == 33:
                own(at_ns, "alarms", event(second, at_ns // 1_000_000, "acknowledged", state="ACKED", by="Ann"))
            if second % 60 == 36:
                own(at_ns, "alarms", event(second, at_ns // 1_000_000, "cleared", state="NORMAL"))
    return file.close(ended="closed")


def _messages(seconds: float, version: RosVersion, lap_s: float) -> Iterator[tuple[float, Message]]:
    """Seconds since the beginning, and the message."""
    lap: list[tuple[float, Message]] = []
    for message in SimulatedCar(seed=3, ros_version=version).messages():
        at_s = message.at_s - START_S
        if at_s >= min(lap_s, seconds):
            break
        if math.isfinite(lap_s):
            lap.append((at_s, message))
        yield at_s, message
    for number in itertools.count(1) if lap else ():
        for at_s, message in lap:
            if at_s + number * lap_s >= seconds:
                return
            yield at_s + number * lap_s, message


if __name__ == "__main__":
    drive(Path(sys.argv[1]), float(sys.argv[2]))
