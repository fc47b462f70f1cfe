"""Each recipe of docs/extending.md applies, touches no more files than it promises, and does what it promises."""

from __future__ import annotations

import csv
import io
import json
import sys
import zipfile
from pathlib import Path

import pytest

from tests.recipes.project_copy import RECIPES, ProjectCopy
from tests.tree import PROJECT

pytestmark = pytest.mark.slow

# Files that a recipe may touch: of the project, and of its tests.
MOST_FILES = {"check": (1, 1), "signal": (2, 1), "export": (1, 0), "tab": (3, 0), "source": (1, 1), "command": (2, 2)}
TOOLS = (
    (".venv/bin/ruff", "check", "--quiet", "."),
    (".venv/bin/ruff", "format", "--check", "--quiet", "."),
    (".venv/bin/mypy",),
    ("node_modules/.bin/tsc", "-p", "."),
)
# What holds for every check, signal, format and tab alike, and the tables of the recipes themselves.
TESTS = (
    "tests/test_layout.py",
    "tests/test_house.py",  # the import rules too
    "tests/monitor/test_catalog.py::test_what_an_alarm_must_have[steering_limit]",
    "tests/monitor/test_catalog.py::test_what_a_check_must_have[steering_limit]",
    "tests/monitor/checks/test_steering_limit.py",
    "tests/monitor/checks/test_three_answers.py",
    "tests/monitor/checks/test_findings.py",
    "tests/monitor/checks/test_frozen.py",
    "tests/server/judge/test_oil.py",
    "tests/server/vehicle/test_recording_source.py",
    "tests/server/vehicle/test_remark.py",  # over the socket and over HTTP
    "tests/server/security/test_text.py::test_the_kinds_of_a_page_are_a_table",
    "tests/server/protocol/test_reference.py",
    "tests/server/web/routes/test_recordings.py::test_the_list",
    "tests/server/recording/export/formats/test_csv_zip.py::test_every_signal_has_a_table_with_its_units",
)


def test_every_recipe_is_described() -> None:
    text = (PROJECT / "docs" / "extending.md").read_text(encoding="utf-8")
    assert {path.stem for path in RECIPES.glob("*.patch")} == set(MOST_FILES)
    assert [name for name in MOST_FILES if f"(recipes/{name}.patch)" not in text] == []


@pytest.mark.parametrize("recipe", MOST_FILES)
def test_a_recipe_applies_alone_and_touches_no_more_files_than_it_promises(plain: ProjectCopy, recipe: str) -> None:
    path = RECIPES / f"{recipe}.patch"
    plain.git("apply", "-C1", "--check", "--cached", str(path))
    files = plain.files_of(path)
    tests = [file for file in files if file.startswith("tests/")]
    assert (len(files) - len(tests), len(tests)) == MOST_FILES[recipe]


@pytest.mark.field
@pytest.mark.timeout(300)
def test_with_all_recipes_the_project_holds_its_rules(extended: ProjectCopy) -> None:
    tests = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS)
    failed = extended.run_all([*TOOLS, tests])
    assert not failed, "\n".join(f"{command}:\n{printed}" for command, printed in failed.items())


def test_the_check_of_the_recipe_raises_its_alarm_and_stands_in_the_reference(
    extended: ProjectCopy, drive: Path
) -> None:
    found = json.loads(extended.run("server", "check", str(drive), "--json", "-"))
    assert "steering_limit" in {episode["alarm"] for episode in found["alarms"]}
    page = (extended.root / "docs" / "alarms.md").read_text(encoding="utf-8")
    assert "**Steering beyond limit** `steering_limit`" in page
    assert "| `steering_limit.max_percent` | Steering limit | 80 % |" in page


def test_the_signal_of_the_recipe_has_a_table(extended: ProjectCopy, drive: Path, tmp_path: Path) -> None:
    extended.run("server", "export", str(drive), "--format", "csv", "--out", str(tmp_path / "drive.zip"))
    with zipfile.ZipFile(tmp_path / "drive.zip") as tables:
        rows = list(csv.reader(io.StringIO(tables.read("oil.csv").decode())))
        assert "Temperature of the engine's oil." in tables.read("README.txt").decode()
    assert rows[0][-1] == "oil [degC]"
    assert [row[-1] for row in rows[1:3]] == ["80.0", "80.05000305175781"]
    assert len(rows) == 1 + 400


def test_the_format_of_the_recipe_is_written(extended: ProjectCopy, drive: Path, tmp_path: Path) -> None:
    extended.run("server", "export", str(drive), "--format", "jsonl", "--out", str(tmp_path / "drive.jsonl"))
    lines = [json.loads(line) for line in (tmp_path / "drive.jsonl").read_text(encoding="utf-8").splitlines()]
    assert len(lines) == 1800
    assert {line["signal"] for line in lines} == {"speed", "brake", "steering", "oil", "position"}
    assert next(line["percent"] for line in lines if line["signal"] == "steering") == -95.0
