"""The page's scripts and styles, bundled and minified when catgraph is installed.

The sources in static/js and static/css are served directly if the bundles are missing or outdated, so that no page is
ever outdated. The build hook loads this file by its path: standard library only.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

FOLDER = "built"  # in static/, beside js/ and css/, so that what they name by ../ is found from here too
STYLES = (
    "tokens",
    "frame",
    "topbar",
    "instruments",
    "map",
    "sheets",
    "screens",
    "settings",
    "slowing",
    "wide",
    "watch",
    "wall",
)  # in this order
ENTRY = "main.js"
EARLY = "boot/early.js"  # inline in the page
THREADS = ("scan/scan-painter",)  # scripts of threads, each joined for itself
_LIST = "built.json"  # written last
_TARGET = "es2022"  # private fields and top-level await: every browser of 2022 and later
_CONFIG = Path(__file__).with_name("rollup.config.mjs")


@dataclass(frozen=True, slots=True, kw_only=True)
class Built:
    """The joined files that the page begins with, as paths within static/."""

    script: str
    style: str
    needed: tuple[str, ...]  # scripts that `script` imports at once
    early: str  # the text of the script that runs before all others
    name: str  # of this build: other sources have another


def join(tools: Path, static: Path) -> None:
    """Build static/built from static/js and static/css with the tools in node_modules/.bin.

    Raises SystemExit with the tool's message.
    """
    into = static / FOLDER
    into.mkdir(exist_ok=True)
    sources = digest_of_sources(static)
    for old in into.iterdir():
        old.unlink()
    with tempfile.TemporaryDirectory(prefix="catgraph-page-") as folder:
        joined, style = Path(folder, "joined"), Path(folder, "page.css")
        small = ["--minify", f"--target={_TARGET}", f"--outdir={into}", "--log-level=error"]
        own = ["--bundle", "--entry-names=[name]-[hash]"]
        threads = [str(static / "js" / f"{name}.js") for name in THREADS]
        _run([str(tools / "esbuild"), *threads, *own, "--format=esm", *small])
        entry = {
            "CATGRAPH_ENTRY": str(static / "js" / ENTRY),
            "CATGRAPH_INTO": str(joined),
            "CATGRAPH_THREADS": json.dumps(
                {f"../{name}.js": next(path.name for path in into.glob(f"{Path(name).name}-*.js")) for name in THREADS}
            ),
        }
        _run([str(tools / "rollup"), "--config", str(_CONFIG), "--silent"], {**os.environ, **entry})
        told = json.loads((joined / "joined.json").read_text(encoding="utf-8"))
        _run([str(tools / "esbuild"), *map(str, sorted(joined.glob("*.js"))), "--format=esm", *small])
        early = _run([str(tools / "esbuild"), str(static / "js" / EARLY), "--minify", f"--target={_TARGET}"])
        imports = (f"@import {json.dumps(str(static / 'css' / f'{name}.css'))};" for name in STYLES)
        style.write_text("\n".join(imports), encoding="utf-8")
        _run([str(tools / "esbuild"), str(style), *own, "--external:../fonts/*", *small])
    listed = {
        "sources": sources,
        "script": f"{FOLDER}/{told['script']}",
        "style": f"{FOLDER}/{next(path.name for path in into.glob('page-*.css'))}",
        "needed": [f"{FOLDER}/{name}" for name in told["needed"]],
        "early": early.strip(),
    }
    (into / _LIST).write_text(json.dumps(listed), encoding="utf-8")


def find(static: Path) -> Built | None:
    """The bundles, or None if they are not of the current sources."""
    try:
        stamps = tuple((str(path), path.stat().st_mtime_ns) for path in _sources(static))
        listed_ns = (static / FOLDER / _LIST).stat().st_mtime_ns
    except OSError:
        return None
    return _find(static, stamps, listed_ns)


def digest_of_sources(static: Path) -> str:
    """Hash of all that the joined files are made of, and of how."""
    digest = hashlib.sha256(f"{STYLES} {_TARGET} {sys.modules[__name__].__doc__}".encode() + _CONFIG.read_bytes())
    for path in _sources(static):
        digest.update(path.relative_to(static).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@lru_cache(maxsize=8)
def _find(static: Path, stamps: tuple[tuple[str, int], ...], listed_ns: int) -> Built | None:
    # The times are arguments only to invalidate the cache; they decide nothing, because a clone has none.
    try:
        listed = json.loads((static / FOLDER / _LIST).read_text(encoding="utf-8"))
        needed, name = tuple(listed["needed"]), listed["sources"][:12]
        script, style, early = listed["script"], listed["style"], listed["early"]
        found = Built(script=script, style=style, needed=needed, early=early, name=name)
        is_whole = all((static / name).is_file() for name in (found.script, found.style, *found.needed))
        return found if is_whole and listed["sources"] == digest_of_sources(static) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _sources(static: Path) -> list[Path]:
    return sorted([*(static / "js").rglob("*.js"), *(static / "css").glob("*.css")])


def _run(command: list[str], environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        raise SystemExit(f"The page's files could not be joined:\n{done.stderr}{done.stdout}")
    return done.stdout


def main(arguments: Iterable[str]) -> None:
    """`python -m server.web.assets.bundle TOOLS`: joins the files of this project, where they are not current."""
    static = Path(__file__).resolve().parents[3] / "static"
    if find(static) is None:
        join(Path(next(iter(arguments))), static)


if __name__ == "__main__":
    main(sys.argv[1:])
