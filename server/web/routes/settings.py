"""The settings of each vehicle over HTTP, as JSON and as a TOML file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Body, HTTPException, Request, Response
from pydantic import BaseModel

from server.protocol import commands
from server.protocol.answers import SettingsAnswer
from server.web.interface import files, takes
from server.web.routes.commands import body_of
from server.web.routes.session_request import OF_VEHICLE, TOML, VehicleName, as_json, as_toml, ask, vehicle_of
from server.web.services import services

router = APIRouter(tags=["settings"], responses=OF_VEHICLE)
if TYPE_CHECKING:
    SettingsChange = BaseModel
else:
    SettingsChange = body_of(commands.Set, is_strict=True)


@router.get(
    "/api/settings", response_model=SettingsAnswer, summary="Settings in force, their defaults, ranges and units"
)
async def settings(request: Request, vehicle: VehicleName = None) -> Response:
    body = await ask(request, vehicle, {"kind": "settings"})
    return as_json({name: value for name, value in body.items() if name != "toml"})


@router.patch("/api/settings", response_model=SettingsAnswer, summary="Change some settings; they count at once")
async def change_settings(
    request: Request, body: Annotated[SettingsChange, Body()], vehicle: VehicleName = None
) -> Response:
    await ask(request, vehicle, {"kind": "set", **body.model_dump()})
    return await settings(request, vehicle)


@router.get(
    "/api/settings.toml", response_class=Response, responses=files(TOML), summary="What was changed, as a TOML file"
)
async def export_settings(request: Request, vehicle: VehicleName = None) -> Response:
    body = await ask(request, vehicle, {"kind": "settings"})
    return as_toml(body["toml"], f"catgraph-{vehicle_of(services(request), vehicle)}.toml")


@router.put(
    "/api/settings.toml",
    response_model=SettingsAnswer,
    openapi_extra=takes(TOML),
    summary="Take all settings from a TOML file",
)
async def import_settings(request: Request, vehicle: VehicleName = None) -> Response:
    try:
        text = (await limited_body(request, 64 * 1024)).decode("utf-8")
    except UnicodeDecodeError:
        raise HTTPException(422, "This is not UTF-8 text.") from None
    await ask(request, vehicle, {"kind": "import", "toml": text})
    return await settings(request, vehicle)


async def limited_body(request: Request, most: int) -> bytes:
    """The body of a request, refused as soon as it is longer than `most` bytes."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > most:
            raise HTTPException(413, f"At most {most // 1024} kB are taken.")
    return body
