"""`catgraph check` over several recordings: each by itself, on all cores, in the order given."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from server.analysis.check_pool import check_each
from server.analysis.check_recording import CANNOT, CRITICAL, NO_CRITICAL, CheckOptions, by_recording
from server.analysis.rehearse import Extract
from server.recording.verify import verify
from server.simulator.scenarios import planned
from tests.interrupted import INTERRUPTED
from tests.server.analysis.conftest import Checking, recorded
from tests.server.recording.made import record
from tests.tree import PROJECT

SHORT = CheckOptions(extract=Extract(duration_s=5.0))


@pytest.fixture(scope="module")
def speeding(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("drive") / "speeding", 20.0, plan=[planned("speeding@3")])


def test_one_that_cannot_be_read_is_named_and_the_others_are_checked(
    check: Checking, healthy: Path, speeding: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "broken.bag"
    broken.write_bytes(b"#ROSBAG V2.0\n" + b"\0" * 40)
    files = [speeding, broken, healthy]
    ending = check(*files, "--json", "-")
    assert ending.code == CANNOT, "whether the broken one held a critical alarm is not known"
    assert [one["recording"]["files"] for one in ending.json] == [[str(speeding)], [str(healthy)]]
    assert [alarm["alarm"] for alarm in ending.json[0]["alarms"]] == ["speed_limit"]
    assert ending.err.count("catgraph check:") == 1
    assert str(broken) in ending.err
    alone = check(speeding, "--json", "-")
    assert ending.json[0]["transitions"] == alone.json["transitions"]
    ending = check(healthy, speeding, "--duration", "15")
    assert ending.code == CRITICAL
    assert ending.out.index(f"Checked {healthy}") < ending.out.index(f"Checked {speeding}")
    assert check(healthy, healthy, "--duration", "5").code == NO_CRITICAL


def test_what_is_said_of_one_names_it(check: Checking, healthy: Path, speeding: Path) -> None:
    ending = check(speeding, healthy, "--start", "22")
    assert ending.code == CANNOT
    assert ending.err.startswith(f"catgraph check: {speeding}: --start 22 is behind the end")
    assert "Checked" in ending.out


def test_a_page_is_of_one_recording(check: Checking, healthy: Path, tmp_path: Path) -> None:
    ending = check(healthy, healthy, "--html", tmp_path / "page.html")
    assert ending.code == CANNOT
    assert "a page of one recording" in ending.err


def test_a_process_that_is_killed_costs_its_own_recording(healthy: Path, speeding: Path) -> None:
    killed: list[int] = []

    def kill_the_first(part: float, judged_s: float) -> None:
        if not killed:
            killed.append(min(child.pid for child in multiprocessing.active_children() if child.pid))
            os.kill(killed[0], signal.SIGKILL)

    first, second = check_each([[healthy], [speeding]], CheckOptions(), kill_the_first)
    assert first.code == CANNOT
    assert str(healthy) in first.errors[0]
    assert second.text is not None


def test_progress_only_grows_and_ends_whole(healthy: Path) -> None:
    seen: list[float] = []
    assert len(list(check_each([[healthy]] * 3, CheckOptions(), lambda part, judged_s: seen.append(part)))) == 3
    assert seen == sorted(seen)
    assert 0.9 < seen[-1] <= 1.0


@pytest.mark.field
def test_ctrl_c_ends_all_of_it(healthy: Path) -> None:
    command = [sys.executable, "-m", "server", "check", *[str(healthy)] * 30]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=PROJECT, start_new_session=True
    )
    assert process.stdout is not None
    process.stdout.readline()  # the first recording is checked
    children = psutil.Process(process.pid).children(recursive=True)
    forker = next(child for child in children if "forkserver" in " ".join(child.cmdline()))
    blocked = re.findall(r"^SigBlk:\t(\w+)", Path(f"/proc/{forker.pid}/status").read_text(), re.MULTILINE)
    assert int(blocked[0], 16) & 1 << signal.SIGINT - 1, "the signal would end one in the middle of its imports"
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode in INTERRUPTED
    assert errors == b""
    _, alive = psutil.wait_procs(children, timeout=10)
    assert alive == []


def test_parts_of_a_recording_of_ours_are_one(tmp_path: Path) -> None:
    first = record(tmp_path / "car" / "a_1.mcap", part="1")
    second = record(tmp_path / "car" / "a_2.mcap", part="2")
    other = record(tmp_path / "car" / "b_1.mcap", session="0the")
    clip = record(tmp_path / "car" / "a_clip.mcap", clip_of="a_1")
    missing = tmp_path / "missing.mcap"
    assert by_recording([first, other, clip, missing, second]) == [[first, second], [other], [clip], [missing]]


def test_the_report_says_whether_the_recording_is_as_it_was_recorded(check: Checking, tmp_path: Path) -> None:
    path = record(tmp_path / "car" / "a_1.mcap", seconds=5.0)
    ending = check(path)
    head = verify(path).head
    assert head is not None
    assert f"Event log: Intact · {head[:8]}\n" in ending.out
    assert f"records, head {head}." in ending.out
    raw = path.read_bytes()
    path.write_bytes(raw[:60] + bytes((raw[60] ^ 1,)) + raw[61:])
    ending = check(path, "--json", "-", "--html", tmp_path / "page.html")
    (found,) = ending.json["recording"]["verified"]
    assert (found["short"], found["is_broken"], found["head"]) == ("Broken at record 1", True, None)
    assert "Event log: Broken at record 1" in (tmp_path / "page.html").read_text()
