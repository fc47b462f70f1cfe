"""The table of other people's programs (docs/peers.md): complete, with the versions that are installed, and honest."""

from __future__ import annotations

import json
import re
from typing import Any

from tests.peers.environment import HERE, version
from tests.peers.suites import NOT_RUN, SUITES
from tests.peers.table import DOCUMENT, HEAD, PART, main, rows, table

SUITE = SUITES[0]


def report(when: str, outcome: str, test: str = "test", **kept: Any) -> dict[str, Any]:
    """A line of pytest's log, of a test of the first suite."""
    whole = {"suite": SUITE.name, "run": 0, "failed": [], "explained": {}, "unexplained": []} | kept
    skipped = ["file.py", 1, "Skipped: it is not installed"]
    return {
        "$report_type": "TestReport",
        "nodeid": test,
        "when": when,
        "outcome": outcome,
        "longrepr": skipped if outcome == "skipped" else None,
        "user_properties": [["peers", whole]],
    }


def test_the_document_has_a_row_for_each_suite_with_the_version_that_runs() -> None:
    found = PART.search(DOCUMENT.read_text(encoding="utf-8"))
    assert found is not None
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in found[0].splitlines()[2:]]
    assert [row[0] for row in cells] == [suite.name for suite in SUITES] + [one.name for one in NOT_RUN]
    pinned = [(row[2], version(suite)) for row, suite in zip(cells, SUITES, strict=False) if suite.registry != "Debian"]
    assert [pair for pair in pinned if pair[0] != pair[1]] == []
    assert "UNEXPLAINED" not in found[0]


def test_each_suite_has_a_test() -> None:
    marked = {
        name
        for path in HERE.glob("test_*.py")
        for name in re.findall(r'mark\.peers\("([^"]+)"', path.read_text(encoding="utf-8"))
    }
    assert {suite.name for suite in SUITES} == marked


def test_a_finding_without_a_reason_is_named_and_makes_the_run_red(tmp_path: Any) -> None:
    log = tmp_path / "log.jsonl"
    log.write_text(
        json.dumps(report("teardown", "passed", run=4, failed=["a"], explained={"as it is": 2}, unexplained=["a | b"]))
    )
    assert main(log) == 1
    row = rows([json.loads(log.read_text())])[0].line()
    assert row.endswith(r"| 4 | 3 | 2: as it is; UNEXPLAINED: a \| b |")


def test_a_test_that_failed_before_its_tally_is_a_finding() -> None:
    row = rows([report("setup", "passed"), report("call", "failed"), report("teardown", "passed")])[0]
    assert row.unexplained == ["test"]


def test_a_skipped_suite_is_a_row_that_did_not_run() -> None:
    row = rows([report("setup", "skipped"), report("teardown", "passed")])[0]
    assert row.line().endswith("| not run |  | not run: it is not installed |")
    assert table([row]).startswith(HEAD)
