"""How the house stands: which part may know which, what files are called, what they may not contain."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import SLOW_TESTS
from tests.stages import TARGETS
from tests.tree import PROJECT, project_files, text_of

EMPTY_NAMES = {"util", "utils", "helper", "helpers", "common", "misc"}

PYTHON = [path for path in project_files() if path.suffix == ".py" and path.parts[0] in ("monitor", "server")]
PAGE = [path for path in project_files() if path.parts[0] in ("static", "templates")]


def test_files_have_names_that_say_something() -> None:
    assert [path for path in project_files() if EMPTY_NAMES & set(re.split(r"[^a-z]+", path.stem.lower()))] == []


def test_every_module_says_its_job() -> None:
    assert [path for path in PYTHON if ast.get_docstring(_tree(path)) is None] == []


@pytest.mark.parametrize(
    ("pattern", "what"),
    [
        (
            r"registry\.(?:npmjs|yarnpkg|npmmirror)|(?:files\.)?pythonhosted\.|\bpypi\.(?:org|python)",
            "a registry's host",
        ),
        (r"(?<![\w.])/(?:work|root)/\w", "a path of one machine"),
        (r"(?<![\w.])/home/(?!catgraph)\w+/", "a path of one machine"),
    ],
)
def test_files_name_no_machine_and_no_registry(pattern: str, what: str) -> None:
    found = [f"{path}: {hit[0]}" for path in project_files() for hit in re.finditer(pattern, text_of(path) or "")]
    assert found == [], f"{what} in {found}"


def test_the_page_loads_nothing_from_elsewhere() -> None:
    """It works on an access point without the internet. Namespaces and links for a person to press are no loads."""
    load = re.compile(
        r"""(?:\bsrc(?:set)?\s*=|<link\b[^>]*\bhref\s*=|\burl\(|@import|\bimport\b[^;'"]*|\bfrom|\bfetch\()"""
        r"""\s*["'`(]*(?:https?:)?//[\w.-]""",
        re.IGNORECASE,
    )
    assert [f"{path}: {hit[0]}" for path in PAGE for hit in load.finditer(text_of(path) or "")] == []


def test_what_drives_a_browser_lies_in_the_folders_of_its_stage() -> None:
    """Any other would be in no stage."""
    (stage,) = (one for one in TARGETS["test-field"] if one.name == "field-page")
    folders = tuple(one for one in stage.selection if one.startswith("tests/"))
    tests = [path for path in project_files() if path.suffix == ".py" and path.parts[0] == "tests"]
    marked = [path for path in tests if re.search(r"\bmark\.browser\b", text_of(path))]
    assert marked != []
    assert [path for path in marked if not path.as_posix().startswith(folders)] == []


def test_nobody_elses_files_are_tracked() -> None:
    assert [path for path in project_files() if {"vendor", "node_modules"} & set(path.parts)] == []


def test_no_module_keeps_state() -> None:
    """Two servers live in one process: no `global`, and no container made empty at module level to be filled later."""
    assert [f"{path}:{line}" for path in PYTHON for line in _module_state(_tree(path))] == []


def _module_state(tree: ast.Module) -> Iterator[int]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Global):
            yield node.lineno
    for statement in tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and _is_empty_container(statement.value):
            yield statement.lineno


def _is_empty_container(value: ast.expr | None) -> bool:
    match value:
        case ast.List(elts=[]) | ast.Dict(keys=[]):
            return True
        case ast.Call(func=ast.Name(id="list" | "dict" | "set" | "deque" | "defaultdict" | "OrderedDict" | "Counter")):
            return not value.args or value.func.id in ("deque", "defaultdict")  # type: ignore[attr-defined]
    return False


@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("SEEN = []", [1]),
        ("SEEN: dict[str, int] = {}", [1]),
        ("SEEN = defaultdict(list)", [1]),
        ("def f():\n    global N\n    N = 1", [2]),
        ("TABLE = {'a': 1}\nORDER = ('a',)\ndef f():\n    seen = []", []),
    ],
)
def test_module_state_is_recognised(source: str, lines: list[int]) -> None:
    assert list(_module_state(ast.parse(source))) == lines


def _tree(path: Path) -> ast.Module:
    return ast.parse((PROJECT / path).read_text(encoding="utf-8"))


def test_what_is_listed_as_slow_exists() -> None:
    """A test that gets another name or file takes its line of `tests/slow_tests.txt` along."""
    found = {
        f"{path}::{name}"
        for path in map(str, project_files())
        if any(one.startswith(f"{path}::") for one in SLOW_TESTS)
        for name in re.findall(r"def (test_\w+)\(", (PROJECT / path).read_text(encoding="utf-8"))
    }
    functions = {re.sub("::.*::", "::", one) for one in SLOW_TESTS if not one.endswith("::runTest")}  # of unittest
    assert functions - found == set()


def test_no_test_is_retried_by_a_mark() -> None:
    """What fails by chance runs again by itself (`tests/stages.py`), and is listed."""
    tests = [path for path in project_files() if path.parts[0] == "tests" and path.name != Path(__file__).name]
    assert [path for path in tests if "mark.flaky" in (text_of(path) or "")] == []
