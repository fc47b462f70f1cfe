"""Channels that are not of ROS, or that nothing declares, in a split bag: each is named once, with its messages."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import pytest

from server.cli.main import main
from server.recording.read.read import open_recording
from tests.server.recording.mcap.test_variants import PLAIN, write

EACH, PARTS = 20, 2
UNKNOWN = 99


def folder(to: Path) -> Path:
    """Numbers and as many messages in protobuf, a second between them; of the last of the numbers' channels the
    declaration is lost."""
    made = to / "drive"
    made.mkdir()
    for part in range(PARTS):
        times = [(n % 3, (part * EACH + n + 1) * 10**9) for n in range(EACH)]
        path = made / f"drive_{part}.mcap"
        write(path, replace(PLAIN, messages=tuple(times), foreign=True, chunking=False))
        head = struct.pack("<BQH", 5, 22 + 8, 3)  # a message with 8 bytes of data on the third channel
        content = path.read_bytes()
        assert content.count(head) == EACH // 3
        path.write_bytes(content.replace(head, struct.pack("<BQH", 5, 22 + 8, UNKNOWN)))
    return made


def test_a_topic_is_named_once_with_all_its_messages(tmp_path: Path) -> None:
    with open_recording([folder(tmp_path)]) as recording:
        assert sorted(recording.notes) == [
            f"/pose ({PARTS * EACH} messages) is left out: messages encoded as 'protobuf' are not supported",
            f"channel {UNKNOWN} ({PARTS * (EACH // 3)} messages) is left out: the file does not declare what they are",
        ]


@pytest.mark.parametrize(("format", "around"), [("bag", None), ("ros2", None), ("bag", "10"), ("mcap", "10")])
def test_an_export_names_it_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str, around: str | None
) -> None:
    out = tmp_path / "out"
    window = [] if around is None else ["--at", around, "--before", "2", "--after", "2"]
    assert main(["export", str(folder(tmp_path)), "--format", format, "--out", str(out), *window]) == 1
    lines = capsys.readouterr().err.splitlines()
    many, few = (5, 2) if around else (PARTS * EACH, PARTS * (EACH // 3))
    (pose,) = [line for line in lines if "/pose" in line and "left out" in line]
    assert f"/pose ({many} messages) is left out: messages encoded as 'protobuf' are not supported." in pose
    (unknown,) = [line for line in lines if f"channel {UNKNOWN}" in line and "left out" in line]
    assert f"channel {UNKNOWN} ({few} messages) is left out: the file does not declare what they are." in unknown
