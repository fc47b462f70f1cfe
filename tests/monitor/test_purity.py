"""The judge is pure: no shell, no clock, no input or output. Its verdict on a recording is the one of the drive."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import monitor
from tests.tree import PROJECT

FILES = sorted(Path(monitor.__file__).parent.rglob("*.py"))
MAY_KNOW = {
    "__future__",
    "abc",
    "array",
    "bisect",
    "collections",
    "dataclasses",
    "enum",
    "functools",
    "heapq",
    "importlib",  # the catalog's walk
    "itertools",
    "math",
    "monitor",
    "numpy",
    "operator",
    "pkgutil",
    "pydantic",
    "re",
    "statistics",
    "traceback",
    "types",
    "typing",
}
FORBIDDEN_CALLS = {"open", "print", "input", "eval", "exec"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.name))
def test_a_module_of_the_judge_knows_nothing_of_the_world(path: Path) -> None:
    known, calls = set(), set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                known |= {alias.name.partition(".")[0] for alias in names}
            case ast.ImportFrom(module=str(module), level=0):
                known.add(module.partition(".")[0])
            case ast.Call(func=ast.Name(id=name)):
                calls.add(name)
    assert known <= MAY_KNOW
    assert not calls & FORBIDDEN_CALLS


def test_the_judge_runs_where_there_is_no_server() -> None:
    """In a process of its own, so that what other tests imported does not count."""
    code = (
        "import sys; import monitor.runner as r; r.Monitor(); "
        "print(sorted({'server', 'asyncio', 'logging', 'fastapi', 'roslibpy'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT, capture_output=True, text=True, check=True, timeout=60
    )
    loaded = done.stdout.strip()
    # pydantic and numpy may load what they like; nothing of ours may be among it.
    assert "server" not in loaded
    assert "fastapi" not in loaded
    assert "roslibpy" not in loaded
