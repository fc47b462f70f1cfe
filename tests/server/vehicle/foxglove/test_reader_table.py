"""Readers are kept while they are used, however many there are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from server.recording.read.errors import Undecodable
from server.vehicle.foxglove import readers
from server.vehicle.foxglove.protocol import Channel
from server.vehicle.foxglove.readers import ReaderTable
from tests.server.link_listener import until

TEXT = Channel(
    id=1, topic="/0", encoding="ros1", type="std_msgs/String", schema="string data\n", schema_encoding="ros1msg"
)
HELLO = b"\x05\x00\x00\x00hello"


async def test_a_reader_in_use_is_not_dropped_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readers, "MOST_READERS", 3)
    ready: list[str] = []
    table = ReaderTable(ready.append, lambda text: None, used=lambda: [TEXT])
    channels = [replace(TEXT, id=number, topic=f"/{number}") for number in range(5)]
    for channel in channels:
        table.is_ready(channel)
    await until(lambda: len(ready) == 5)
    assert table.read(TEXT, HELLO) == {"data": "hello"}
    assert table.read(channels[-1], HELLO) == {"data": "hello"}
    with pytest.raises(Undecodable):
        table.read(channels[1], HELLO)
