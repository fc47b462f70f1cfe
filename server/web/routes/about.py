"""What runs here, for the page's License and About: versions, the work of others in it, its JSON interface."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from pathlib import Path

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse
from fastapi.templating import Jinja2Templates
from pydantic import BaseModel

from server.system.page_files import static_dir, templates_dir
from server.web.interface import raises
from server.web.services import services

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


router = APIRouter()


class ThirdPartyPart(BaseModel):
    """A part of somebody else's."""

    name: str
    version: str
    license: str
    where: str


class About(BaseModel):
    """What runs here."""

    version: str
    python: str
    system: str
    parts: list[ThirdPartyPart]


def _parts() -> tuple[Part, ...]:
    return parts(static_dir() / "vendor")


@router.get("/api/about", tags=["server"], summary="Versions of the server and of everything in it")
def about(request: Request) -> About:
    return About(
        version=services(request).version,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        parts=[
            ThirdPartyPart(name=part.name, version=part.version, license=part.license, where=part.where)
            for part in _parts()
        ],
    )


@router.get(
    "/api/notices/{name}",
    response_class=PlainTextResponse,
    responses=raises(404),
    tags=["server"],
    summary="The licence text of one part",
)
def notice(name: str) -> PlainTextResponse:
    part = next((part for part in _parts() if part.name == name), None)
    if part is None:
        raise HTTPException(404, f"No part is named {name[:40]}.")
    return PlainTextResponse(part.text or f"{part.name} brings no text; its maker calls its licence {part.license}.")


@router.get("/openapi.json", include_in_schema=False)
def described(request: Request) -> JSONResponse:
    """Making it takes half a second: in a thread, by `def`."""
    return JSONResponse(request.app.openapi())


@router.get("/docs", response_class=HTMLResponse, include_in_schema=False)
def docs(request: Request) -> HTMLResponse:
    """The description of the interface as a page of our own: FastAPI's loads its scripts from the internet."""
    schema = request.app.openapi()
    context = {
        "info": schema["info"],
        "paths": schema["paths"],
        "schemas": schema.get("components", {}).get("schemas", {}),
    }
    return Jinja2Templates(directory=templates_dir()).TemplateResponse(request, "docs.html", context)
