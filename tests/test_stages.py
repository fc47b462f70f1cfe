"""The table of docs/testing.md names tests that exist, in the stage that the marks give them."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache

import pytest

from tests.tree import PROJECT

PROMISES = ("No false comfort", "Every alarm reaches an operator", "No recorded data is lost")
CASES = tuple(f"Case {number}" for number in range(1, 21))
STAGES = {"gate": "not field and not soak", "field": "field and not soak", "soak": "soak"}
ROW = re.compile(r"^\| ([^|]+) \| `(tests/[^|`]+::\w+)` \| (\w+) \|$", re.MULTILINE)


def rows() -> list[tuple[str, str, str]]:
    """What is proved, by which test, in which stage."""
    return ROW.findall((PROJECT / "docs" / "testing.md").read_text(encoding="utf-8"))


@cache
def collected() -> dict[str, set[str]]:
    """The tests of each stage, of the files that the table names, without their parameters."""
    files = sorted({test.partition("::")[0] for _, test, _ in rows()})
    command = (sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider")
    started = {
        stage: subprocess.Popen([*command, "-m", marks, *files], cwd=PROJECT, stdout=subprocess.PIPE, text=True)
        for stage, marks in STAGES.items()
    }
    printed = {stage: process.communicate()[0] for stage, process in started.items()}
    return {stage: set(re.findall(r"^(tests/\S+?::\w+)", text, re.MULTILINE)) for stage, text in printed.items()}


@pytest.mark.parametrize("what", [*PROMISES, *CASES])
def test_each_promise_and_each_case_has_a_test_in_the_gate(what: str) -> None:
    assert [test for proved, test, stage in rows() if (proved, stage) == (what, "gate")] != []


def test_the_table_names_nothing_else() -> None:
    table = (PROJECT / "docs" / "testing.md").read_text(encoding="utf-8").partition("| proves |")[2]
    assert len(rows()) == table.count("\n|") - 1, "a row that is not read"
    assert {proved for proved, _, _ in rows()} == {*PROMISES, *CASES}


@pytest.mark.slow
def test_each_test_of_the_table_is_in_its_stage() -> None:
    stages = collected()
    assert [(test, stage) for _, test, stage in rows() if test not in stages[stage]] == []
