"""Whose work is in catgraph, for the page's License and About."""

from __future__ import annotations

import platform

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import PlainTextResponse
from pydantic import BaseModel

from server.system.page_files import static_dir
from server.web.assets.third_party import Part, parts
from server.web.interface import raises
from server.web.services import services

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
