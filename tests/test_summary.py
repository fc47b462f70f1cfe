"""What `make test` prints at its end."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.summary import faults, main, read_stage, summary


def report(name: str, when: str, outcome: str, start: float, stop: float, why: str = "", printed: str = "") -> str:
    longrepr = {"reprcrash": {"message": why}} if why else None
    kind = {"$report_type": "TestReport", "nodeid": name, "when": when, "outcome": outcome, "longrepr": longrepr}
    sections = [["Captured stdout setup", "a server starts\n"], ["Captured stdout call", printed]]
    return json.dumps(kind | {"start": start, "stop": stop, "duration": stop - start, "sections": sections})


def whole(name: str, start: float, s: float, outcome: str = "passed", why: str = "") -> list[str]:
    end = start + s
    return [
        report(name, "setup", "passed", start, start),
        report(name, "call", outcome, start, end, why),
        report(name, "teardown", "passed", end, end),
    ]


def write(path: Path, lines: list[str]) -> str:
    path.write_text("\n".join(lines), encoding="utf-8")
    return str(path)


def test_each_way_a_test_ends_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    skipped = [report("t::c", "setup", "skipped", 3, 4), report("t::c", "teardown", "passed", 4, 4)]
    lines = whole("t::a", 0, 2) + whole("t::b", 2, 1, "failed", "assert 1 == 2\nand more") + skipped
    assert main([write(tmp_path / "fast.jsonl", lines)]) == 1
    shown = capsys.readouterr()
    assert "fast             1        1       1         0      0.0" in shown.out
    assert shown.err == "FAILED t::b: assert 1 == 2\n"


def test_a_test_that_never_ended_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its process was ended, with the last line of the log cut off."""
    lines = [*whole("t::a", 0, 1), report("t::hangs", "setup", "passed", 1, 1), '{"$report_type": "Test']
    assert main([write(tmp_path / "browser.jsonl", lines)]) == 1
    assert capsys.readouterr().err == "NEVER ENDED t::hangs\n"


def test_a_stage_that_did_not_begin_is_no_success(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "slow.jsonl")]) == 1
    assert capsys.readouterr().err == "NO TESTS in stage slow\n"


def test_the_slowest_come_first_and_the_total_is_of_all_stages(tmp_path: Path) -> None:
    one = read_stage(Path(write(tmp_path / "fast.jsonl", whole("t::a", 1, 60) + whole("t::b", 61, 120))))
    other = read_stage(Path(write(tmp_path / "slow.jsonl", whole("t::c", 1, 90))))
    lines = summary([one, other])
    assert [line.split()[-1] for line in lines if " s  " in line] == ["t::b", "t::c", "t::a"]
    assert [line.split()[-1] for line in lines if line.startswith("total")] == ["4.5"]


def test_each_proof_is_a_row_with_what_it_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [
        report("t::kills", "call", "passed", 0, 90, printed="begins\n1000 kills, nothing lost\n\n"),
        report("t::silent", "call", "failed", 90, 96, "assert 0"),
    ]
    assert main(["--each", write(tmp_path / "soak.jsonl", lines)]) == 1
    rows = capsys.readouterr().out.splitlines()
    assert rows[2:4] == ["passed       1.5  t::kills: 1000 kills, nothing lost", "failed       0.1  t::silent"]


def test_slow_functions_are_named_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fast = whole("t::a[1]", 0, 1.2) + whole("t::a[2]", 2, 3) + whole("t::b", 5, 0.2)
    logs = [write(tmp_path / "fast.jsonl", fast), write(tmp_path / "slow.jsonl", whole("t::T::c", 6, 2))]
    assert main(["--slow", *logs]) == 0
    assert capsys.readouterr().out == "t::T::c\nt::a\n"


def test_a_crash_and_a_timeout_are_no_accidents(tmp_path: Path) -> None:
    """Only a test that failed of itself runs again by itself."""
    lines = [
        *whole("t::late", 0, 2, "failed", "Failed: Timeout (>120.0s) from pytest-timeout."),
        *whole("t::wrong", 2, 1, "failed", "assert 1 == 2"),
        report("t::ended", "setup", "passed", 3, 3),
        report("t::ended", "???", "failed", 0, 0, "worker 'gw0' crashed while running 't::ended'"),
    ]
    result = read_stage(Path(write(tmp_path / "page.jsonl", lines)))
    assert set(result.failed) == {"t::late", "t::wrong", "t::ended"}
    assert result.failed_once == {"t::wrong": "assert 1 == 2"}


def test_an_unstable_test_is_no_failure(tmp_path: Path) -> None:
    lines = whole("t::a", 0, 2) + whole("t::b", 2, 1, "failed", "assert 1 == 2")
    result = read_stage(Path(write(tmp_path / "page.jsonl", lines))).without(["t::b"])
    assert faults([result]) == []
    assert summary([result])[2].split() == ["page", "1", "0", "0", "1", "0.0"]
