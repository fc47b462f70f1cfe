"""How large the parts may be: packages, files, classes and functions; and that no modules import in a circle."""

from __future__ import annotations

import ast
import json
import subprocess
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from tests.tree import PROJECT, project_files, text_of

MOST_PACKAGES = 20  # in server/
MOST_ENTRIES = 16  # in static/js/
MOST_LINES = {"file": 350, "class": 250, "function": 60}
LOOSE_MODULES = {"__init__.py", "__main__.py", "version.py"}
FOLDERS = ("server", "monitor", "vehicle", "static/js")

# What is still larger than its limit, with its present size: it may only shrink, and its entry goes with it.
# Of import circles the entry counts the modules of a package that are part of one.
ALLOWED: dict[str, int] = {}

Sizes = dict[str, int]
Graph = Mapping[str, set[str]]


def test_server_holds_packages_only() -> None:
    entries = {path.parts[1:] for path in project_files() if path.parts[0] == "server" and path.suffix == ".py"}
    assert {parts[0] for parts in entries if len(parts) == 1} <= LOOSE_MODULES
    assert len({parts[0] for parts in entries if len(parts) > 1}) <= MOST_PACKAGES


def test_the_pages_folder_is_one_screenful() -> None:
    entries = {path.parts[2] for path in project_files() if path.parts[:2] == ("static", "js")}
    assert 1 < len(entries) <= MOST_ENTRIES


def test_no_part_is_too_large() -> None:
    assert _too_much(_sizes(), ALLOWED) == []


def test_no_modules_import_in_a_circle() -> None:
    assert _too_much(_circles(), ALLOWED) == []


def test_every_entry_is_still_needed() -> None:
    found = _sizes() | _circles()
    assert [name for name in ALLOWED if found.get(name, 0) <= _limit(name)] == []


def _too_much(found: Sizes, allowed: Mapping[str, int]) -> list[str]:
    """What is larger than its limit, and than it was."""
    return [
        f"{name}: {size}, at most {max(_limit(name), allowed.get(name, 0))}"
        for name, size in sorted(found.items())
        if size > max(_limit(name), allowed.get(name, 0))
    ]


def _limit(name: str) -> int:
    return MOST_LINES.get(name.partition(" ")[0], 0)


@cache
def _sizes() -> Sizes:
    """Lines of each file, class and function, by "class server/x.py Name"; of several with one name the most."""
    sizes: Sizes = {}
    for path, kind, name, lines in (*_python_parts(), *_page_parts()):
        key = f"{kind} {path} {name}".strip()
        sizes[key] = max(lines, sizes.get(key, 0))
    return sizes


@cache
def _circles() -> Sizes:
    """How many modules of each package are part of an import circle, by "circle server.x"."""
    found: Sizes = {}
    for module in sorted(_in_circles(_python_imports()) | _in_circles(_page_imports())):
        package = str(Path(module).parent) if module.endswith(".js") else ".".join(module.split(".")[:2])
        found[f"circle {package}"] = found.get(f"circle {package}", 0) + 1
    return found


def _paths(suffix: str) -> list[Path]:
    folders = tuple(f"{folder}/" for folder in FOLDERS)
    return [path for path in project_files() if path.suffix == suffix and path.as_posix().startswith(folders)]


def _lines(path: Path) -> int:
    return len((text_of(path) or "").splitlines())


def _python_parts() -> Iterator[tuple[Path, str, str, int]]:
    for path in _paths(".py"):
        yield path, "file", "", _lines(path)
        for kind, name, lines in _definitions(ast.parse(text_of(path) or "")):
            yield path, kind, name, lines


def _definitions(node: ast.AST, outer: str = "") -> Iterator[tuple[str, str, int]]:
    """Classes and functions with their names as Python qualifies them, from the first line of the definition."""
    for child in ast.iter_child_nodes(node):
        name = outer
        if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            name = f"{outer}.{child.name}".lstrip(".")
            kind = "class" if isinstance(child, ast.ClassDef) else "function"
            yield kind, name, (child.end_lineno or child.lineno) - child.lineno + 1
        yield from _definitions(child, name)


def _page_parts() -> Iterator[tuple[Path, str, str, int]]:
    for path in _paths(".js"):
        yield path, "file", "", _lines(path)
    for name, facts in _page_modules().items():
        for kind in ("class", "function"):
            for part, lines in facts[kind]:
                yield Path(name), kind, part, lines


@cache
def _page_modules() -> dict[str, dict[str, list[list[object]]]]:
    """What `page_modules.mjs` finds in each JavaScript file."""
    found = subprocess.run(
        ["node", "tests/page_modules.mjs", *(path.as_posix() for path in _paths(".js"))],
        cwd=PROJECT,
        capture_output=True,
        check=True,
    )
    modules: dict[str, dict[str, list[list[object]]]] = json.loads(found.stdout)
    return modules


def _page_imports() -> Graph:
    return {name: set(facts["imports"]) for name, facts in _page_modules().items()}  # type: ignore[arg-type]


def _python_imports() -> Graph:
    """Every import counts: inside functions and for types alone too."""
    modules = {".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in _paths(".py")}
    return {name: _imported(ast.parse(text_of(path) or ""), modules) for name, path in modules.items()}


def _imported(tree: ast.Module, modules: Mapping[str, Path]) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (whole & modules.keys()) | ({node.module} if whole - modules.keys() else set())
    return found & modules.keys()


def _in_circles(imports: Graph) -> set[str]:
    """The modules that import themselves over others."""
    return {name for name in imports if name in _reached(imports, name)}


def _reached(imports: Graph, start: str) -> set[str]:
    """All that a module imports, directly or over others."""
    found: set[str] = set()
    left = [start]
    while left:
        new = imports.get(left.pop(), set()) - found
        found |= new
        left += new
    return found


@pytest.mark.parametrize(
    ("found", "allowed", "wrong"),
    [
        ({"file a.py": 350, "class a.py A": 250, "function a.py A.f": 60}, {}, []),
        ({"file a.py": 351}, {}, ["file a.py: 351, at most 350"]),
        ({"class a.py A": 251}, {"class a.py A": 251}, []),
        ({"class a.py A": 252}, {"class a.py A": 251}, ["class a.py A: 252, at most 251"]),
        ({"function a.py f": 61}, {}, ["function a.py f: 61, at most 60"]),
        ({"circle server.a": 2}, {}, ["circle server.a: 2, at most 0"]),
    ],
)
def test_what_is_too_large_is_recognised(found: Sizes, allowed: Sizes, wrong: list[str]) -> None:
    assert _too_much(found, allowed) == wrong


def test_circles_are_recognised() -> None:
    assert _in_circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}, "e": set()}) == {"b", "c"}


def test_imports_are_recognised() -> None:
    modules = {name: Path() for name in ("server.a", "server.a.b", "server.c")}
    tree = ast.parse("from server.a import b\ndef f():\n    from server.a import name\nimport server.c\nimport json")
    assert _imported(tree, modules) == {"server.a", "server.a.b", "server.c"}


def test_sizes_are_recognised() -> None:
    tree = ast.parse("class A:\n    def f(self):\n        def g():\n            pass\n        return g")
    assert list(_definitions(tree)) == [("class", "A", 5), ("function", "A.f", 4), ("function", "A.f.g", 2)]


def test_parts_of_the_page_are_recognised(tmp_path: Path) -> None:
    (tmp_path / "a.js").write_text("import './b.js';\nexport class A {\n  f() {\n    import('./c.js');\n  }\n}\n")
    (tmp_path / "b.js").write_text("export * from './c.js';\nexport const g = () => {\n};\n")
    command = ["node", PROJECT / "tests" / "page_modules.mjs", "a.js", "b.js"]
    found = json.loads(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True).stdout)
    assert found == {
        "a.js": {"function": [["f", 3]], "class": [["A", 5]], "imports": ["b.js", "c.js"]},
        "b.js": {"function": [["g", 2]], "class": [], "imports": ["c.js"]},
    }
