"""MCAP of other tools: channels that are not of ROS, indexes left out; and our own recording copied by such a tool."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.cli.main import main
from server.recording.marks.recorded import in_file
from server.recording.read.read import open_recording
from server.recording.verify import verify
from tests.reports.cases import counted, made, run
from tests.server.recording.made import record

MESSAGES = 200
FOREIGN = {
    "with-json": "/notes (200 messages) is left out: its messages are JSON, and of no ROS type",
    "with-json-without-schema": "/notes (200 messages) is left out: its messages are JSON, and of no ROS type",
    "with-protobuf": "/pose (200 messages) is left out: messages encoded as 'protobuf' are not supported",
}
LACKING = ("plain", "without-message-index", "without-any-index", "without-chunks", "without-summary-offsets")


def mixed(name: str) -> Path:
    return made("case_40_mixed_mcap.py") / "40-mixed-mcap" / f"{name}.mcap"


@pytest.mark.parametrize("name", FOREIGN)
def test_case_40_channels_of_other_kinds_are_named_and_the_rest_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    path = mixed(name)
    assert counted(path) == (MESSAGES, [FOREIGN[name]])
    assert main(["check", str(path)]) == 2
    assert FOREIGN[name] in capsys.readouterr().err
    for form in ("bag", "ros2", "csv"):
        assert main(["export", str(path), "--format", form, "--out", str(tmp_path / form)]) == 1
        errors = capsys.readouterr().err
        assert errors.count(FOREIGN[name].partition(":")[0]) == 1
        assert "the export is incomplete" in errors
    assert counted(tmp_path / "bag") == (MESSAGES, [])


@pytest.mark.parametrize("name", LACKING)
def test_case_40_whatever_indexes_it_has(tmp_path: Path, name: str) -> None:
    assert counted(mixed(name)) == (MESSAGES, [])
    assert main(["check", str(mixed(name))]) == 0
    assert main(["export", str(mixed(name)), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 0
    assert counted(tmp_path / "out.bag") == (MESSAGES, [])


def test_case_40_a_clip_names_what_it_cannot_hold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "clip.mcap"
    assert main(["export", str(mixed("with-protobuf")), "--format", "mcap", "--at", "5", "--out", str(out)]) == 1
    assert "/pose (200 messages) is left out" in capsys.readouterr().err
    assert counted(out) == (MESSAGES, [])


def test_case_40b_our_own_recording_copied_by_another_tool_is_the_same(tmp_path: Path) -> None:
    ours = record(tmp_path / "car" / "car_20260921T141320Z.mcap", alarms=[(5.0, "critical")])
    copy = tmp_path / "copy.mcap"
    run("rewrite_mcap.py", str(ours), str(copy), "some tool 1.0", into=tmp_path)
    with open_recording([ours]) as one, open_recording([copy]) as other:
        assert other.metadata == one.metadata
        assert other.topics == one.topics
        assert [str(row) for row in other.rows()] == [str(row) for row in one.rows()]
        assert list(other.own("/catgraph/alarms")) == list(one.own("/catgraph/alarms")) != []
        assert (other.notes, other.damage) == ([], [])
    assert in_file(copy) == in_file(ours)
    found = verify(copy)
    assert (found.state, found.sentence) == (
        "no chain",
        "Has no chain: a recording of catgraph, written anew by some tool 1.0.",
    )
    assert verify(ours).state == "intact"


def test_case_40b_check_reports_the_same_of_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours = record(tmp_path / "car" / "car_20260921T141320Z.mcap", alarms=[(5.0, "critical")])
    copy = tmp_path / "copy.mcap"
    run("rewrite_mcap.py", str(ours), str(copy), "some tool 1.0", into=tmp_path)
    codes, lines = [], []
    for path in (ours, copy):
        codes.append(main(["check", str(path)]))
        text = capsys.readouterr().out
        lines.append([line for line in text.splitlines() if "messages on" in line or line.startswith("  Vehicle")])
    assert codes[0] == codes[1]
    assert lines[0] == lines[1]
