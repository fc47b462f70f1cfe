"""The table of `make peers`: what each suite ran, what passed, and what did not with the reason why that is right.

    python -m tests.peers.table out/tests/peers.jsonl [--write]

`--write` puts it into docs/peers.md. A failed test without a finding of its suite is an unexplained finding too.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.peers.environment import version
from tests.peers.suites import NOT_RUN, SUITES, Suite
from tests.tree import PROJECT

DOCUMENT = PROJECT / "docs" / "peers.md"
HEAD = "| suite | from | version | what it does | run | passed | findings, and why they are right |"
PART = re.compile(r"^\| suite \|.*\n(?:\|.*\n)*", re.MULTILINE)


@dataclass
class Row:
    """What the tests of one suite gave."""

    suite: Suite
    run: int = 0
    failed: int = 0
    explained: Counter[str] = field(default_factory=Counter)  # reason → findings
    unexplained: list[str] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)  # why it did not run here

    def add(self, test: str, outcome: str, kept: dict[str, Any]) -> None:
        self.run += kept["run"]
        self.failed += len(kept["failed"])
        self.explained.update(kept["explained"])
        self.unexplained += kept["unexplained"] or ([test] if outcome == "failed" else [])

    def line(self) -> str:
        suite = self.suite
        findings = [f"{count}: {why}" for why, count in self.explained.items()]
        findings += [f"UNEXPLAINED: {' '.join(one.split())[:200]}" for one in self.unexplained]
        findings += [f"not run: {why}" for why in sorted(self.skipped)]
        counts = (f"{self.run:,}", f"{self.run - self.failed:,}") if self.run else ("not run", "")
        return _line(suite.name, suite.registry, version(suite), suite.checks, *counts, "; ".join(findings))


def rows(reports: Iterable[dict[str, Any]]) -> list[Row]:
    """A row for each suite, from the lines of pytest's log."""
    found = {suite.name: Row(suite) for suite in SUITES}
    failed: set[str] = set()
    for report in reports:
        kept = dict(report.get("user_properties", ())).get("peers")
        if kept is None:
            continue
        test, row = report["nodeid"], found[kept["suite"]]
        if report["outcome"] == "failed":
            failed.add(test)
        elif report["outcome"] == "skipped":
            row.skipped.add(report["longrepr"][2].removeprefix("Skipped: "))
        if report["when"] == "teardown":
            row.add(test, "failed" if test in failed else report["outcome"], kept)
    return list(found.values())


def table(of: Iterable[Row]) -> str:
    """The rows as Markdown, with what no registry has below."""
    absent = [_line(one.name, "none", "", "", "not run", "", one.why) for one in NOT_RUN]
    return "\n".join([HEAD, re.sub(r"[^|]+", "---", HEAD), *(row.line() for row in of), *absent]) + "\n"


def _line(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def main(log: Path, *options: str) -> int:
    """Print the table; 1 where a finding has no reason."""
    found = rows(json.loads(line) for line in log.read_text(encoding="utf-8").splitlines())
    made = table(found)
    print(made)
    if "--write" in options:
        text = DOCUMENT.read_text(encoding="utf-8")
        assert PART.search(text), f"{DOCUMENT} has no table"
        DOCUMENT.write_text(PART.sub(lambda _: made, text), encoding="utf-8")
    return 1 if any(row.unexplained for row in found) else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *sys.argv[2:]))
