"""docs/security.md is true: it covers each requirement, and each test it names is there."""

from __future__ import annotations

import ast
import re

import pytest

from server.protocol.rate_limit import Limits
from tests.tree import PROJECT, project_files, text_of

PAGE = (PROJECT / "docs" / "security.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (\d+\.\d+\.\d+) \| (.+?) \| (\S*) ?\|$", PAGE, re.M)
# The requirements of level 1 in ASVS 5.0.0, and those of level 2 that are required besides.
LEVEL_1 = """1.2.1 1.2.2 1.2.3 1.2.4 1.2.5 1.3.1 1.3.2 1.5.1 2.1.1 2.2.1 2.2.2 2.3.1 3.2.1 3.2.2 3.3.1 3.4.1 3.4.2 3.5.1
3.5.2 3.5.3 4.1.1 4.4.1 5.2.1 5.2.2 5.3.1 5.3.2 6.1.1 6.2.1 6.2.2 6.2.3 6.2.4 6.2.5 6.2.6 6.2.7 6.2.8 6.3.1 6.3.2 6.4.1
6.4.2 7.2.1 7.2.2 7.2.3 7.2.4 7.4.1 7.4.2 8.1.1 8.2.1 8.2.2 8.3.1 9.1.1 9.1.2 9.1.3 9.2.1 10.4.1 10.4.2 10.4.3 10.4.4
10.4.5 11.3.1 11.3.2 11.4.1 12.1.1 12.2.1 12.2.2 13.4.1 14.2.1 14.3.1 15.1.1 15.2.1 15.3.1""".split()
LEVEL_2 = ["3.4.3", "4.4.2", "4.4.3", "4.4.4", "5.4.2", "16.4.1"]


def test_each_requirement_stands_once() -> None:
    assert sorted(number for number, _, _ in ROWS) == sorted({*LEVEL_1, *LEVEL_2})
    assert len(ROWS) == 76


@pytest.mark.parametrize(("number", "how", "test"), ROWS, ids=[row[0] for row in ROWS])
def test_each_names_a_test_that_exists(number: str, how: str, test: str) -> None:
    if not test:
        assert how.startswith("n/a"), number
        return
    path, _, name = test.partition("::")
    tree = ast.parse((PROJECT / path).read_text(encoding="utf-8"))
    there = {one.name for one in tree.body if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)}
    assert name.startswith("test_")
    assert name in there


def test_the_limits_are_those_in_force() -> None:
    limits = Limits()
    for stated in (
        f"{limits.body_bytes // 1024} kB, 64 kB for settings; {limits.body_s:g} s until",
        f"{limits.head_bytes // 1024} kB; {limits.head_s:g} s until",
        f"{limits.requests.per_s:g} a second, {limits.requests.at_once} at once (on an open server all of this "
        f"machine: {limits.local_requests.per_s:g}, {limits.local_requests.at_once})",
        f"connections from one address | {limits.connections} |",
        f"sockets of one device | {limits.pages} |",
        f"{limits.messages.per_s:g} a second, {limits.messages.at_once} at once",
        f"{limits.commands.per_s:g} a second, {limits.commands.at_once} at once",
    ):
        assert stated in PAGE


def test_the_times_for_other_peoples_parts_are_written_down() -> None:
    part = PAGE.partition("## Parts of others")[2].partition("\n## ")[0]
    for text in ("two working days", "within a week", "within a month", "every three months", "make sbom"):
        assert text in part.replace("\n", " ")


def test_no_shell_and_no_code_from_text() -> None:
    """Nothing that turns text into orders of the system, into code, into markup or into a tree of XML with entities."""
    of_python = re.compile(
        r"\bos\.(system|popen)\b|\bshell\s*=\s*True|(?<![\w.])eval\(|\bexec\(|\bmarshal\.|\byaml\.load\b"
        r"|\bimport xml\b|from xml\.(?!sax\.saxutils import escape)|\bElementTree\b|\bminidom\b|\blxml\b"
    )
    of_page = re.compile(r"\b(inner|outer)HTML\b|insertAdjacentHTML|document\.write|\beval\(|new Function\(|\bsrcdoc\b")
    found = []
    for path in project_files():
        pattern = {".py": of_python, ".js": of_page}.get(path.suffix)
        if pattern is None or path.parts[0] not in ("server", "monitor", "static"):
            continue
        found += [f"{path.as_posix()}: {hit[0]}" for hit in pattern.finditer(text_of(path) or "")]
    compiled = [  # names enter as quoted text only
        f"{path}.py: exec(" for path in ("server/recording/read/decode", "server/recording/read/encode")
    ]
    assert sorted(found) == compiled
