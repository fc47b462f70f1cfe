"""A copy of the project whose page can be changed while it is served, joined as an installed one is."""

from __future__ import annotations

import shutil
from pathlib import Path

from server.web.assets.bundle import join
from server.web.assets.icons import draw
from tests.tree import PROJECT

MODULES = PROJECT / "node_modules"


def copy(into: Path) -> Path:
    """The project's programs and page, joined and with its icons drawn."""
    for name in ("server", "monitor", "templates", "static"):
        shutil.copytree(PROJECT / name, into / name, ignore=shutil.ignore_patterns("__pycache__", "built", "drawn"))
    for name in ("package.json", "package-lock.json"):
        shutil.copy(PROJECT / name, into / name)
    build(into)
    assert draw(MODULES, into / "static") is None
    return into


def build(house: Path) -> None:
    """Joins the page anew, as an update does."""
    (house / "static" / "built").mkdir(exist_ok=True)
    join(MODULES / ".bin", house / "static")


def change(house: Path, mark: str) -> None:
    """Another version of the page: the script that begins it and one that is fetched later both bear `mark`."""
    for name, key in (("main.js", "app"), ("shell/about.js", "about")):
        path = house / "static" / "js" / name
        text = path.read_text(encoding="utf-8").split("\n// --- another version ---\n")[0]
        path.write_text(f"{text}\n// --- another version ---\ndocument.documentElement.dataset['{key}'] = '{mark}';\n")
    build(house)
