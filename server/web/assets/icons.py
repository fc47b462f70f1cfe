"""PNG icons for phones and launchers without SVG support, rendered when catgraph is installed.

They are in static/drawn and never committed. If they cannot be rendered, only the SVG is served. The build hook loads
this file by its path: standard library only.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SHORTCUTS = (("Map", "map"), ("Scan", "scan"), ("Files", "files"), ("Settings", "settings"))  # of the page's tabs
_INK = "#0a0c0d"  # the dark panel of VISUAL.md, behind the icon while the page begins
_ANY = "icons/catgraph.svg"


def manifest(asset: Callable[[str], str], *, are_drawn: bool) -> dict[str, Any]:
    """https://www.w3.org/TR/appmanifest/ · `asset`: the address of a static file; `are_drawn`: the PNGs are there."""
    icons = [{"src": asset(_ANY), "sizes": "any", "type": "image/svg+xml", "purpose": "any"}]
    if are_drawn:
        icons += [
            {
                "src": asset(f"{FOLDER}/{icon.name}"),
                "sizes": f"{icon.side}x{icon.side}",
                "type": "image/png",
                "purpose": icon.purpose,
            }
            for icon in ICONS
            if icon.purpose
        ]
    else:
        for kind in ("maskable", "monochrome"):
            source = asset(f"icons/catgraph-{kind}.svg")
            icons.append({"src": source, "sizes": "any", "type": "image/svg+xml", "purpose": kind})
    return {
        "id": "/",
        "name": "catgraph",
        "short_name": "catgraph",
        "description": "Monitors an autonomous test car. Not an emergency stop.",
        "lang": "en",
        "dir": "ltr",
        "start_url": "/",
        "scope": "/",
        "display": "standalone",
        "orientation": "any",
        "categories": ["utilities", "productivity"],
        "background_color": _INK,
        "theme_color": _INK,
        "prefer_related_applications": False,
        "icons": icons,
        "shortcuts": [{"name": name, "url": f"/#{tab}", "icons": _small(asset, are_drawn)} for name, tab in SHORTCUTS],
    }


def _small(asset: Callable[[str], str], are_drawn: bool) -> list[dict[str, str]]:
    if are_drawn:
        return [{"src": asset(f"{FOLDER}/icon-192.png"), "sizes": "192x192", "type": "image/png"}]
    return [{"src": asset(_ANY), "sizes": "any", "type": "image/svg+xml"}]


FOLDER = "drawn"  # in static/
WITHOUT = (
    "The icons were not rendered as PNG when catgraph was installed: only the SVG is served, and a phone without "
    "SVG support shows a picture of the page instead."
)
_STAMP = "drawn.json"  # written last
_LONGEST_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Icon:
    """One picture: `purpose` as the manifest of a web application has it, "" for what only the page names."""

    name: str
    of: str
    side: int  # px
    purpose: str = ""


ICONS = (
    Icon(name="icon-192.png", of="catgraph.svg", side=192, purpose="any"),
    Icon(name="icon-512.png", of="catgraph.svg", side=512, purpose="any"),
    Icon(name="maskable-192.png", of="catgraph-maskable.svg", side=192, purpose="maskable"),
    Icon(name="maskable-512.png", of="catgraph-maskable.svg", side=512, purpose="maskable"),
    Icon(name="monochrome-512.png", of="catgraph-monochrome.svg", side=512, purpose="monochrome"),
    Icon(name="apple-touch-icon.png", of="catgraph-maskable.svg", side=180),  # iOS rounds the corners itself
    Icon(name="favicon.png", of="catgraph.svg", side=48),
)

# resvg as WebAssembly: the same bytes on every processor, and nothing to compile.
_PROGRAM = """
import { readFile, writeFile } from 'node:fs/promises';
import { pathToFileURL } from 'node:url';
const { modules, icons } = JSON.parse(process.argv[1]);
const resvg = `${modules}/@resvg/resvg-wasm`;
const { initWasm, Resvg } = await import(pathToFileURL(`${resvg}/index.mjs`));
await initWasm(await readFile(`${resvg}/index_bg.wasm`));
for (const { of, side, into } of icons) {
  const drawn = new Resvg(await readFile(of, 'utf8'), { fitTo: { mode: 'width', value: side } }).render();
  await writeFile(into, drawn.asPng());
}
"""


def draw(modules: Path, static: Path) -> str | None:
    """Makes static/drawn; why not, as one sentence, where it cannot."""
    node = shutil.which("node")
    if node is None:
        return "Node, which draws the icons, is not on the PATH."
    into = static / FOLDER
    shutil.rmtree(into, ignore_errors=True)
    try:
        into.mkdir()
        wanted = [{"of": str(_source(static, i)), "side": i.side, "into": str(into / i.name)} for i in ICONS]
        job = json.dumps({"modules": str(modules.resolve()), "icons": wanted})
        command = [node, "--input-type=module", "-e", _PROGRAM, job]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_LONGEST_S)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "Error" in line] or ["no reason was given"]
            return f"The icons could not be drawn: {lines[0].strip()[:200]}."
        (into / _STAMP).write_text(json.dumps({"sources": digest_of_sources(static)}), encoding="utf-8")
    except (OSError, subprocess.SubprocessError) as why:
        return f"The icons could not be drawn: {str(why)[:200]}."
    return None


def are_drawn(static: Path) -> bool:
    """Whether all icons exist and are of the current sources."""
    try:
        stamp = json.loads((static / FOLDER / _STAMP).read_text(encoding="utf-8"))
        is_current: bool = stamp["sources"] == digest_of_sources(static)
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return is_current and all((static / FOLDER / icon.name).is_file() for icon in ICONS)


def digest_of_sources(static: Path) -> str:
    """Hash of the drawings and of what is made of them."""
    digest = hashlib.sha256(f"{ICONS}{_PROGRAM}".encode())
    for name in sorted({icon.of for icon in ICONS}):
        digest.update((static / "icons" / name).read_bytes() + b"\0")
    return digest.hexdigest()


def _source(static: Path, icon: Icon) -> Path:
    return (static / "icons" / icon.of).resolve()


def main(arguments: Iterable[str]) -> None:
    """`python -m server.web.assets.icons NODE_MODULES`: draws the icons of this project, where they are not current."""
    static = Path(__file__).resolve().parents[3] / "static"
    if not are_drawn(static):
        why = draw(Path(next(iter(arguments))), static)
        if why is not None:
            print(f"{why} {WITHOUT}", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1:])
