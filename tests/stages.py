"""Runs the stages of a make target, runs each failed test again by itself, and prints the result.

    python -m tests.stages test

A failed test runs again in a fresh process, with nothing else running, at most twice. If it passes, it is unstable: it
is listed with its first reason and kept in out/tests/unstable.txt, and up to five of them leave the run green. A test
that fails again, a crash, a timeout, a test that never ended and a stage without tests make it red.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.summary import StageResult, faults, read_stage, summary

ATTEMPTS = 2
MOST_UNSTABLE = 5
MOST_RUN_ALONE = 20  # more failures than this are no accident, and are not looked at one by one
FOLDER = Path("out/tests")
PASSED, FAILED = 0, 1  # pytest's exit codes of a run that reached its end


@dataclass(frozen=True, slots=True)
class Stage:
    """One run of pytest: which tests, and with which options and further environment. Both also hold where a test runs
    by itself."""

    name: str
    selection: tuple[str, ...]
    options: tuple[str, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Alone:
    """What became of the failed tests that ran again: those that passed, by their first reason, and all others."""

    unstable: dict[str, str]
    failed: tuple[str, ...]


# More workers than the machine has cores: some tests wait for processes, browsers and timers.
THREE, FOUR = (("-n", number, "--dist", "worksteal") for number in "34")
NOT_PAGE = "--ignore=tests/page"
# Pages of a real server, which is an agent, a broker and a web node in this stage.
THROUGH_BROKER = ("tests/page/test_report_cases.py", "tests/page/test_alarms.py")
TARGETS = {
    # asyncio's debug mode is on here only, and in the tests' own process only: it takes a fifth more time.
    "check": (
        Stage("quick", (NOT_PAGE, *THREE, "-q", "-m", "not (browser or slow or field or soak)"), ("--asyncio-debug",)),
    ),
    "test": (
        Stage("server", (NOT_PAGE, *FOUR, "-m", "not (browser or field or soak)")),
        Stage("page", ("tests/page", *THREE, "-m", "gate and not soak")),
    ),
    "test-field": (
        Stage("field", (NOT_PAGE, *THREE, "-m", "field and not (browser or soak)")),
        Stage("field-page", ("tests/page", "tests/recipes", "-m", "browser and not (gate or soak)")),
        Stage(
            "page-through-broker",
            (*THROUGH_BROKER, "-m", "browser and not soak"),
            environment={"CATGRAPH_THROUGH_BROKER": "1"},
        ),
    ),
}


def pytest_run(stage: Stage, arguments: Sequence[str], log: Path, cwd: Path) -> int:
    """Run pytest in a process of its own. Returns its exit code."""
    log.unlink(missing_ok=True)
    command = [sys.executable, "-m", "pytest", f"--report-log={log}", *stage.options, *arguments]
    environment = {**os.environ, **stage.environment}
    return subprocess.run(command, cwd=cwd, stdin=subprocess.DEVNULL, check=False, env=environment).returncode


def run_alone(stage: Stage, failed: dict[str, str], folder: Path, cwd: Path) -> Alone:
    """Run each of these failed tests again by itself."""
    unstable: dict[str, str] = {}
    again = []
    for name, reason in failed.items():
        if len(unstable) + len(again) < MOST_RUN_ALONE and any(
            _passes(stage, name, folder / "alone.jsonl", cwd) for _ in range(ATTEMPTS)
        ):
            unstable[name] = reason
        else:
            again.append(name)
    return Alone(unstable, tuple(again))


def _passes(stage: Stage, name: str, log: Path, cwd: Path) -> bool:
    print(f"\nby itself: {name}", flush=True)
    code = pytest_run(stage, ("-q", name), log, cwd)
    return code == PASSED and read_stage(log).outcomes.get(name) == "passed"


def run(stages: Sequence[Stage], folder: Path = FOLDER, cwd: Path = Path()) -> int:
    """Run these stages. Returns 0 where all is well, else 1."""
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    results: list[tuple[Stage, StageResult]] = []
    wrong: list[str] = []
    for stage in stages:
        log = folder / f"{stage.name}.jsonl"
        code = pytest_run(stage, stage.selection, log, cwd)
        result = read_stage(log)
        results.append((stage, result))
        if code not in (PASSED, FAILED) or (code == FAILED and not result.failed):
            wrong.append(f"STAGE {stage.name} ended with exit code {code}")
    unstable: dict[str, str] = {}
    shown = []
    for stage, result in results:
        alone = run_alone(stage, result.failed_once, folder, cwd)
        unstable |= alone.unstable
        shown.append(result.without(alone.unstable))
    lines = [f"{name}: {reason}" for name, reason in unstable.items()]
    (folder / "unstable.txt").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    print("\n".join([*summary(shown), *([f"\n{len(lines)} unstable", *lines] if lines else [])]), flush=True)
    wrong += faults(shown)
    if len(unstable) > MOST_UNSTABLE:
        wrong.append(f"UNSTABLE {len(unstable)} tests, at most {MOST_UNSTABLE} are allowed")
    if wrong:
        print("\n".join(wrong), file=sys.stderr, flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(run(TARGETS[sys.argv[1]]))
