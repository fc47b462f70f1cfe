"""The summary of each kind of recording: its offsets name the groups that exist, and no others;
a doctor of MCAP finds nothing wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Footer, SummaryOffset
from mcap.stream_reader import StreamReader

from server.recording.export.clip import Window, write_clip
from server.recording.folder import writing_path
from server.recording.mcap.write import PartFile
from server.recording.read.read import open_recording
from server.recording.recover import recover
from tests.server.recording.mcap.doctor import REMARKS, examined
from tests.server.recording.mcap.test_write import AT_NS, written
from tests.tree import PROJECT


def attached(path: Path) -> PartFile:
    file = written(path, 1)
    file.attach("mark-1.webm", "audio/webm", AT_NS, b"voice")
    file.flush()
    return file


def closed(path: Path) -> Path:
    return written(path, 1).close(ended="closed")


def closed_with_attachment(path: Path) -> Path:
    return attached(path).close(ended="closed")


def without_messages(path: Path) -> Path:
    return PartFile(path, profile="ros1", metadata={"vehicle": "car"}).close(ended="closed")


def recovered(path: Path) -> Path:
    written(path, 1, n=4).abandon()
    recover(writing_path(path))
    return path


def recovered_with_attachment(path: Path) -> Path:
    attached(path).abandon()
    recover(writing_path(path))
    return path


def cut_out(path: Path) -> Path:
    with open_recording([closed(path.with_name("whole.mcap"))]) as recording:
        write_clip(recording, path, Window(at_ns=AT_NS, before_s=1.0, after_s=1.0), clip_of="whole")
    return path


def killed(path: Path) -> Path:
    """Recovered after kill -9 of the process that wrote it."""
    code = f"from {__name__} import die_writing; die_writing({str(path)!r})"
    ended = subprocess.run([sys.executable, "-c", code], cwd=PROJECT, check=False)
    assert ended.returncode == -signal.SIGKILL
    recover(writing_path(path))
    return path


def die_writing(path: str) -> None:
    file = attached(Path(path))
    os.kill(os.getpid(), signal.SIGKILL)
    file.abandon()  # never reached: until then the file is held


MAKES = (closed, closed_with_attachment, without_messages, recovered, recovered_with_attachment, cut_out)


@pytest.mark.parametrize("make", MAKES)
def test_each_group_of_the_summary_has_its_offset_and_no_offset_is_empty(
    tmp_path: Path, make: Callable[[Path], Path]
) -> None:
    path = make(tmp_path / "car_1.mcap")
    with path.open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
        file.seek(0)
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    groups = {
        Opcode.SCHEMA: summary.schemas,
        Opcode.CHANNEL: summary.channels,
        Opcode.STATISTICS: [summary.statistics],
        Opcode.CHUNK_INDEX: summary.chunk_indexes,
        Opcode.ATTACHMENT_INDEX: summary.attachment_indexes,
        Opcode.METADATA_INDEX: summary.metadata_indexes,
    }
    offsets = [record for record in records if isinstance(record, SummaryOffset)]
    footer = records[-1]
    assert isinstance(footer, Footer)
    assert [one.group_opcode for one in offsets] == [opcode for opcode, group in groups.items() if group]
    assert all(one.group_length > 0 for one in offsets)
    assert offsets[0].group_start == footer.summary_start
    assert all(one.group_start + one.group_length == other.group_start for one, other in pairwise(offsets))
    assert offsets[-1].group_start + offsets[-1].group_length == footer.summary_offset_start


@pytest.mark.parametrize("make", [closed, killed, cut_out])
def test_a_doctor_finds_nothing_wrong(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    path = make(tmp_path / "car_1.mcap")
    findings, summary = examined(path)
    assert [row for row in findings if row["code"] not in REMARKS] == []
    assert (summary["exit_code"], summary["type"], summary["errors"], summary["complete"]) == (0, "summary", 0, True)
    assert summary["messages"] == 20
