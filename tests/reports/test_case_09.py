"""An MCAP file without a summary, statistics or repeated records is read whole (rerun#10915, foxglove/mcap#369)."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.cli.main import main
from tests.reports.cases import counted, made

MESSAGES = 780
LACKING = ("whole", "without-summary", "without-statistics", "without-repeats", "without-chunk-index")


@pytest.mark.parametrize("profile", ["ros2", "plain"])
@pytest.mark.parametrize("what", LACKING)
def test_case_09_each_is_read_whole(profile: str, what: str) -> None:
    path = made("case_09_mcap_without_summary.py") / "09-mcap-without-summary" / f"{profile}-{what}.mcap"
    assert counted(path) == (MESSAGES, [])


@pytest.mark.parametrize("what", LACKING)
def test_case_09_check_and_export_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    path = made("case_09_mcap_without_summary.py") / "09-mcap-without-summary" / f"plain-{what}.mcap"
    assert main(["check", str(path)]) == 1  # a speeding alarm
    assert f"{MESSAGES} messages on 3 topics" in capsys.readouterr().out
    assert main(["export", str(path), "--format", "bag", "--out", str(tmp_path / "out.bag")]) == 0
    assert counted(tmp_path / "out.bag") == (MESSAGES, [])
