"""Prints what the stages of a run gave: counts, the slowest tests, what was unstable, failed or never ended.

    python -m tests.summary out/tests/server.jsonl out/tests/page.jsonl …
    python -m tests.summary --each out/tests/soak.jsonl
    python -m tests.summary --slow out/tests/server.jsonl > tests/slow_tests.txt

With `--each`, every test is a row, with the last line that it printed: what it measured. With `--slow`, only the names
of the tests that took more than 0.3 s are printed, for the file from which they are marked.
Each file is the log of one stage as pytest-reportlog writes it: a line of JSON for each phase of each test. What failed
and what never ended goes to the error output, as the last lines there.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

SLOWEST = 10
LONGEST_REASON = 200  # characters
SLOW_S = 0.3
TIMED_OUT = re.compile(r"Timeout \(>[\d.]+ ?s\) from pytest-timeout")
CRASHED = "???"  # the phase that pytest-xdist reports of a test whose worker ended


@dataclass(frozen=True, slots=True)
class StageResult:
    """One stage's tests by how they ended, the seconds that each took, and the stage's own length in seconds."""

    name: str
    length_s: float
    seconds: dict[str, float] = field(default_factory=dict)
    outcomes: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    crashed: frozenset[str] = frozenset()
    unfinished: tuple[str, ...] = ()
    printed: dict[str, str] = field(default_factory=dict)

    @property
    def failed_once(self) -> dict[str, str]:
        """The failed tests that may have failed by chance: no crash, no timeout, none that never ended."""
        return {
            name: why
            for name, why in self.failed.items()
            if name not in self.crashed and name not in self.unfinished and not TIMED_OUT.search(why)
        }

    def without(self, unstable: Iterable[str]) -> StageResult:
        """This result, where these failed tests passed by themselves."""
        names = frozenset(unstable) & self.failed.keys()
        failed = {name: why for name, why in self.failed.items() if name not in names}
        return replace(self, failed=failed, outcomes=self.outcomes | dict.fromkeys(names, "unstable"))


def read_stage(path: Path) -> StageResult:
    """A stage from its log; an empty stage where there is no such file, for then it never began."""
    reports = list(_reports(path.read_text(encoding="utf-8").splitlines())) if path.is_file() else []
    times_s = [float(one[when]) for one in reports for when in ("start", "stop") if one[when]]  # 0: its worker crashed
    stage = StageResult(path.stem, max(times_s) - min(times_s) if times_s else 0.0)
    open_tests: dict[str, None] = {}
    crashed = set()
    for one in reports:
        name, when, outcome = one["nodeid"], one["when"], one["outcome"]
        stage.seconds[name] = stage.seconds.get(name, 0.0) + float(one["duration"])
        if when == "setup":
            open_tests[name] = None
        if when == "teardown":
            open_tests.pop(name, None)
        if when == "call":
            stage.printed[name] = _last_line_printed(one)
        if when == CRASHED:
            crashed.add(name)
        if outcome == "failed":
            stage.failed[name] = _reason(one)
            stage.outcomes[name] = outcome
        elif when == "call" or outcome == "skipped":
            stage.outcomes[name] = outcome
    return replace(stage, unfinished=tuple(open_tests), crashed=frozenset(crashed))


def _reports(lines: Iterable[str]) -> Iterator[dict[str, Any]]:
    """The reports of tests. A last line that was cut off, as by a kill, is left out."""
    for line in lines:
        try:
            one = json.loads(line)
        except ValueError:
            continue
        if one.get("$report_type") == "TestReport":
            yield one


def _reason(report: dict[str, Any]) -> str:
    """The first line of why a test failed."""
    why = report.get("longrepr")
    text = why.get("reprcrash", {}).get("message", "") if isinstance(why, dict) else str(why or "")
    return str(text).partition("\n")[0][:LONGEST_REASON]


def _last_line_printed(report: dict[str, Any]) -> str:
    """The last line that the test itself wrote to its standard output; empty where it wrote nothing."""
    written = "".join(text for title, text in report.get("sections", ()) if title == "Captured stdout call")
    return written.strip().rpartition("\n")[2][:LONGEST_REASON]


def each(stage: StageResult) -> list[str]:
    """A row for each test of a stage, in the order in which they ran."""
    rows = [f"{'result':8}{'minutes':>8}  test: what it printed"]
    for name, outcome in stage.outcomes.items():
        printed = f": {stage.printed[name]}" if stage.printed.get(name) else ""
        rows.append(f"{outcome:8}{stage.seconds[name] / 60:8.1f}  {name}{printed}")
    return ["", *rows]


def slow(stages: Iterable[StageResult]) -> list[str]:
    """The names of functions of which one test took longer than SLOW_S, in order."""
    return sorted({name.partition("[")[0] for stage in stages for name, s in stage.seconds.items() if s > SLOW_S})


def summary(stages: Iterable[StageResult]) -> list[str]:
    """The lines of the table and the slowest tests."""
    stages = tuple(stages)
    lines = ["", "stage       passed  skipped  failed  unstable  minutes"]
    for stage in stages:
        counts = Counter(stage.outcomes.values())
        row = (counts["passed"], counts["skipped"], counts["failed"], counts["unstable"])
        lines.append(f"{stage.name:10}{row[0]:8}{row[1]:9}{row[2]:8}{row[3]:10}{stage.length_s / 60:9.1f}")
    lines.append(f"{'total':10}{sum(stage.length_s for stage in stages) / 60:44.1f}")
    seconds = {name: s for stage in stages for name, s in stage.seconds.items()}
    lines += ["", f"the {SLOWEST} slowest"]
    return lines + [f"{s:7.1f} s  {name}" for name, s in sorted(seconds.items(), key=lambda one: -one[1])[:SLOWEST]]


def faults(stages: Iterable[StageResult]) -> list[str]:
    """A line for each test that failed, never ended, and for each stage without any test."""
    lines = []
    for stage in stages:
        lines += [f"FAILED {name}: {why}" for name, why in stage.failed.items()]
        lines += [f"NEVER ENDED {name}" for name in stage.unfinished]
        lines += [] if stage.seconds else [f"NO TESTS in stage {stage.name}"]
    return lines


def main(arguments: list[str]) -> int:
    stages = [read_stage(Path(path)) for path in arguments if not path.startswith("--")]
    if "--slow" in arguments:
        print("\n".join(slow(stages)))
        return 0
    rows = [row for stage in stages for row in each(stage)] if "--each" in arguments else []
    print("\n".join([*rows, *summary(stages)]), flush=True)
    wrong = faults(stages)
    if wrong:
        print("\n".join(wrong), file=sys.stderr, flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
