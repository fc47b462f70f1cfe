"""A copy of the project in which recipes are applied; what is installed beside it is linked."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.tree import PROJECT, project_files

RECIPES = PROJECT / "docs" / "recipes"
INSTALLED = (".venv", "node_modules", "static/vendor")  # of these only a test's own links are in the copy


class ProjectCopy:
    """The project's files at `root`, in a git of its own whose index is the project without any recipe."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for path in project_files():
            target = root / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / path, target)
        for name in INSTALLED:
            if (PROJECT / name).exists():
                (root / name).symlink_to(PROJECT / name)
        if (PROJECT / ".mypy_cache").is_dir():  # a second instead of a minute
            shutil.copytree(PROJECT / ".mypy_cache", root / ".mypy_cache")
        self.git("init", "--quiet")
        self.git("add", "--all")

    def git(self, *arguments: str) -> str:
        """What git prints; raises CalledProcessError where it fails."""
        command = ["git", "-c", "core.hooksPath=/dev/null", *arguments]
        return subprocess.run(command, cwd=self.root, capture_output=True, text=True, check=True).stdout

    def files_of(self, recipe: Path) -> list[str]:
        """The files that a recipe changes or adds."""
        return [line.split("\t")[2] for line in self.git("apply", "--numstat", str(recipe)).splitlines()]

    def start(self, *command: str) -> subprocess.Popen[str]:
        """A Python module or a tool of `.venv`, in the copy."""
        return subprocess.Popen(
            command, cwd=self.root, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
        )

    def run(self, *arguments: str) -> str:
        """What `python -m …` prints in the copy; fails the test with it where it fails."""
        process = self.start(sys.executable, "-m", *arguments)
        printed = process.communicate()[0]
        assert process.returncode == 0, f"{' '.join(arguments)}:\n{printed}"
        return printed

    def run_all(self, commands: Sequence[Sequence[str]]) -> dict[str, str]:
        """Runs commands side by side; what those print that fail, by command."""
        started = [(" ".join(command), self.start(*command)) for command in commands]
        printed = [(name, process.communicate()[0], process.returncode) for name, process in started]
        return {name: text for name, text, code in printed if code}
