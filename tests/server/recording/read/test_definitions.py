"""Definitions of other programs: what their own tools accept is read."""

from __future__ import annotations

import struct

import pytest

from server.recording.read.decode import compile_decoder
from server.recording.read.definitions import definitions_of
from server.recording.read.source import Channel

FIELDS = ["float32 speed", "string name", "uint8[2] two", "made_msgs/Wheel wheel"]
NESTED = ["=" * 80, "MSG: made_msgs/Wheel", "int16 turns"]
RAW = struct.pack("<fI2s2Bh", 2.5, 2, b"ab", 7, 8, -3)


@pytest.mark.parametrize(
    "constant",
    [
        "int8 kLeft=1",
        "int8 k = 3 # why",
        "int8 k =3",
        "uint8 kA =255",
        "float32 kPi = 3.14",
        "string n = a b",
        "string NAME = a b",
        "int32 Mode_manual=-1",
        "string NONE=",
        "string Greeting=one = two # three",
        "bool is_on=true",
    ],
)
@pytest.mark.parametrize("place", [0, 2, 4])
def test_a_constant_that_genmsg_accepts_hides_no_field(constant: str, place: int) -> None:
    lines = [*FIELDS[:place], constant, *FIELDS[place:], *NESTED]
    channel = Channel(
        number=0,
        topic="/state",
        type="made_msgs/msg/State",
        definition="\n".join(lines) + "\n",
        format="msg",
        encoding="ros1",
        count=1,
        is_latched=False,
    )
    read = compile_decoder(channel.type, definitions_of(channel, 1, None), 1)
    assert read(RAW) == {"speed": 2.5, "name": "ab", "two": b"\x07\x08", "wheel": {"turns": -3}}
