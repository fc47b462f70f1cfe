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
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

FOLDER = "built"  # in static/, beside js/ and css/, so that what they name by ../ is found from here too
FONTS = "fonts"  # in static/
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
    "ledge",
)  # in this order
ENTRY = "main.js"
FLEET_STYLES = ("tokens", "frame", "topbar", "sheets", "fleet")
FLEET_ENTRY = "shell/fleet.js"  # joined for itself, so that the page of one car is no larger by it
EARLY = "boot/early.js"  # inline in the page
THREADS = ("scan/scan-painter",)  # scripts of threads, each joined for itself
_FOLDERS = ("js", "css", FONTS, "vendor")  # in static/, with all that the joined files are made of or name
_LIST = "built.json"  # written last
_TARGET = "es2022"  # private fields and top-level await: every browser of 2022 and later
_CONFIG = Path(__file__).with_name("rollup.config.mjs")


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """The joined files that a page begins with, as paths within static/."""

    script: str
    style: str
    needed: tuple[str, ...]  # scripts that `script` imports at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Built(Entry):
    """Those of the page of one car, and what all pages share."""

    early: str  # the text of the script that runs before all others
    fonts: tuple[str, ...]  # that the styles name, as paths within static/
    name: str  # of this build: other sources have another
    fleet: Entry  # the page of all cars


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
        esbuild, small = str(tools / "esbuild"), _small(into)
        threads = [str(static / "js" / f"{name}.js") for name in THREADS]
        _run([esbuild, *threads, *_OWN, "--format=esm", *small])
        _run([esbuild, *(str(static / "css" / f"{name}.css") for name in _later_styles(static)), *_OWN, *small])
        page = _join_entry(tools, static, ENTRY, STYLES, Path(folder, "page"))
        fleet = _join_entry(tools, static, FLEET_ENTRY, FLEET_STYLES, Path(folder, "fleet"))
        early = _run([esbuild, str(static / "js" / EARLY), "--minify", f"--target={_TARGET}"])
    fonts = [f"{FOLDER}/{path.name}" for path in sorted(into.glob("*.woff2"))]
    listed = {"sources": sources, **asdict(page), "early": early.strip(), "fonts": fonts, "fleet": asdict(fleet)}
    (into / _LIST).write_text(json.dumps(listed), encoding="utf-8")


def _later_styles(static: Path) -> list[str]:
    """Those that the page fetches with the part that needs them."""
    return sorted(path.stem for path in (static / "css").glob("*.css") if path.stem not in {*STYLES, *FLEET_STYLES})


def _vendor(static: Path) -> list[Path]:
    return sorted(path for path in (static / "vendor").glob("*") if path.suffix in (".js", ".css"))


def _hashed(into: Path, name: str) -> str:
    """The name that esbuild gave to a file of its own: with the hash of what is in it."""
    plain = Path(name)
    return next(path.name for path in into.glob(f"{plain.stem}-????????{plain.suffix}"))


_OWN = ("--bundle", "--entry-names=[name]-[hash]")


def _small(into: Path) -> list[str]:
    return ["--minify", f"--target={_TARGET}", f"--outdir={into}", "--log-level=error"]


def _join_entry(tools: Path, static: Path, script: str, styles: tuple[str, ...], folder: Path) -> Entry:
    """Join the modules and styles of one page; `folder` has its name, and is made."""
    into, esbuild = static / FOLDER, str(tools / "esbuild")
    folder.mkdir()
    threads = {f"../{name}.js": _hashed(into, f"{Path(name).name}.js") for name in THREADS}
    later = {name: _hashed(into, f"{name}.css").removesuffix(".css") for name in _later_styles(static)}
    vendor = {path.name: hashlib.sha256(path.read_bytes()).hexdigest()[:12] for path in _vendor(static)}
    entry = {
        "CATGRAPH_ENTRY": str(static / "js" / script),
        "CATGRAPH_INTO": str(folder / "joined"),
        "CATGRAPH_THREADS": json.dumps(threads),
        "CATGRAPH_STYLES": json.dumps(later),
        "CATGRAPH_VENDOR": json.dumps(vendor),
    }
    _run([str(tools / "rollup"), "--config", str(_CONFIG), "--silent"], {**os.environ, **entry})
    joined = json.loads((folder / "joined" / "joined.json").read_text(encoding="utf-8"))
    _run([esbuild, *map(str, sorted((folder / "joined").glob("*.js"))), "--format=esm", *_small(into)])
    style = folder / f"{folder.name}.css"
    style.write_text(
        "\n".join(f"@import {json.dumps(str(static / 'css' / f'{name}.css'))};" for name in styles), encoding="utf-8"
    )
    _run([esbuild, str(style), *_OWN, "--loader:.woff2=file", *_small(into)])
    return Entry(
        script=f"{FOLDER}/{joined['script']}",
        style=f"{FOLDER}/{_hashed(into, f'{folder.name}.css')}",
        needed=tuple(f"{FOLDER}/{name}" for name in joined["needed"]),
    )


def find(static: Path) -> Built | None:
    """The bundles, or None if they are not of the current sources."""
    try:
        stamps = tuple(sorted(stamp for folder in _FOLDERS for stamp in _stamps(f"{static}/{folder}")))
        listed_ns = (static / FOLDER / _LIST).stat().st_mtime_ns
    except OSError:
        return None
    return _find(static, stamps, listed_ns)


def digest_of_sources(static: Path) -> str:
    """Hash of all that the joined files are made of, and of how."""
    digest = hashlib.sha256(
        f"{STYLES} {FLEET_STYLES} {_TARGET} {sys.modules[__name__].__doc__}".encode() + _CONFIG.read_bytes()
    )
    for path in _sources(static):
        digest.update(path.relative_to(static).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@lru_cache(maxsize=8)
def _find(static: Path, stamps: tuple[tuple[str, int], ...], listed_ns: int) -> Built | None:
    # The times are arguments only to invalidate the cache; they decide nothing, because a clone has none.
    try:
        listed = json.loads((static / FOLDER / _LIST).read_text(encoding="utf-8"))
        page, fleet = _entry_of(listed), _entry_of(listed["fleet"])
        fonts, name = tuple(listed["fonts"]), listed["sources"][:12]
        found = Built(**asdict(page), early=listed["early"], fonts=fonts, name=name, fleet=fleet)
        files = [*fonts, *(name for one in (page, fleet) for name in (one.script, one.style, *one.needed))]
        is_whole = all((static / name).is_file() for name in files)
        return found if is_whole and listed["sources"] == digest_of_sources(static) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _entry_of(listed: dict[str, Any]) -> Entry:
    return Entry(script=listed["script"], style=listed["style"], needed=tuple(listed["needed"]))


def _stamps(folder: str) -> Iterator[tuple[str, int]]:
    """Each source below `folder` and when it changed; not by pathlib, which takes ten times as long, for each page."""
    with os.scandir(folder) as entries:
        for one in entries:
            if one.is_dir():
                yield from _stamps(one.path)
            elif one.name.endswith((".js", ".css", ".woff2")):
                yield one.path, one.stat().st_mtime_ns


def _sources(static: Path) -> list[Path]:
    fonts = (static / FONTS).glob("*.woff2")
    return sorted([*(static / "js").rglob("*.js"), *(static / "css").glob("*.css"), *fonts, *_vendor(static)])


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
