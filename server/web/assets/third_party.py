"""Whose work is in catgraph: each part with its version, its licence and the licence's text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from pathlib import Path

_TEXT = re.compile(r"^(LICEN[CS]E|COPYING|NOTICE)", re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z0-9][\w.-]*")
_LONGEST = 60  # letters of a licence's name; longer is its text
# Parts of the page: the file in the vendor folder that names the version, and the licence as SPDX.
_OF_PAGE = (
    ("Leaflet", "leaflet.js", r"Leaflet (\d[\w.]*)", "BSD-2-Clause", "leaflet.LICENSE.txt"),
    ("uPlot", "uPlot.esm.js", r"\(v(\d[\w.]*)\)", "MIT", "uPlot.LICENSE.txt"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Somebody else's work, as delivered with catgraph."""

    name: str
    version: str
    license: str  # SPDX if declared, else the declared name; "see its text" without one
    where: str  # "page" or "server"
    text: str  # of its licence files; "" where it brings none


@lru_cache(maxsize=4)
def parts(vendor: Path) -> tuple[Part, ...]:
    """Everything that is installed because catgraph needs it, by name; the page's parts first."""
    return (*_of_page(vendor), *sorted(_of_server("catgraph"), key=lambda part: part.name.lower()))


def _of_page(vendor: Path) -> list[Part]:
    found = []
    for name, file, version, license, text in _OF_PAGE:
        head = (vendor / file).read_text("utf-8", "replace")[:1000]
        match = re.search(version, head)
        full_text = (vendor / text).read_text("utf-8", "replace")
        found.append(
            Part(name=name, version=match[1] if match else "unknown", license=license, where="page", text=full_text)
        )
    return found


def _of_server(root: str) -> list[Part]:
    """Walks what `root` requires, without its extras; what is not installed here is not delivered."""
    seen: dict[str, Part | None] = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        key = re.sub(r"[-_.]+", "-", name).lower()
        if key in seen:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        seen[key] = None if name == root else _part(distribution)
        for requirement in distribution.requires or ():
            match = _NAME.match(requirement)
            if match and "extra ==" not in requirement:
                waiting.append(match[0])
    return [part for part in seen.values() if part is not None]


def _part(distribution: metadata.Distribution) -> Part:
    about = distribution.metadata
    texts = []
    for file in distribution.files or ():
        if _TEXT.match(file.name) and ".dist-info" in file.parts[0]:
            path = Path(str(file.locate()))
            if path.is_file():
                texts.append(path.read_text("utf-8", "replace").strip())
    return Part(
        name=about["Name"],
        version=distribution.version,
        license=_license(about),
        where="server",
        text="\n\n\n".join(texts),
    )


def _license(about: metadata.PackageMetadata) -> str:
    stated = next((about[name].strip() for name in ("License-Expression", "License") if name in about), "")
    if stated and len(stated) <= _LONGEST and "\n" not in stated:
        return str(stated)
    kinds = [one.rsplit("::", 1)[1].strip() for one in about.get_all("Classifier", []) if one.startswith("License ::")]
    return ", ".join(kinds) or "see its text"
