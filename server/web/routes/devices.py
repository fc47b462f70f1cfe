"""Pairing over HTTP: pair a device, issue socket tickets, manage the list of devices."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

import segno
from fastapi import APIRouter, Body, HTTPException, Path, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from server.access.access import NotPaired
from server.access.credentials import TICKET_LASTS_S as TICKET_LASTS_S
from server.access.devices import Device
from server.access.identity import Principal, Role, principal_of
from server.access.invitations import LASTS_S
from server.protocol.answers import DeviceList, DeviceRow
from server.system.loopback import is_loopback
from server.web.interface import raises
from server.web.middleware.errors import Problem
from server.web.routes.session_request import Done
from server.web.services import services

router = APIRouter()
DeviceId = Annotated[str, Path(max_length=40)]
_NOT_KEPT = "The list of devices cannot be stored on the server's disk"


class PairRequest(BaseModel):
    """Either the token of the link or the PIN."""

    model_config = ConfigDict(extra="forbid", strict=True)
    token: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    pin: Annotated[str, Field(min_length=1, max_length=20, examples=["123456"])] | None = None
    name: Annotated[str, Field(max_length=200, description="What this device is to be called")] = ""


class Me(BaseModel):
    """The identity of the client."""

    id: str
    name: str
    role: Role


class Ticket(BaseModel):
    ticket: str
    expires_in_s: float = TICKET_LASTS_S


class InviteRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    role: Role = Role.VIEWER


class Invited(BaseModel):
    """For one device, once: a link to scan, or a PIN to type."""

    role: Role
    pin: str
    link: str
    qr: str = Field(description="The link as a QR code: a data: URI of an SVG")
    expires_in_s: float


class DeviceChange(BaseModel):
    model_config = ConfigDict(extra="forbid")
    role: Role | None = None
    name: Annotated[str, Field(min_length=1, max_length=200)] | None = None


def _me(who: Principal) -> Me:
    return Me(id=who.id, name=who.name, role=who.role)


@router.post(
    "/api/pair", responses=raises(503), tags=["access"], summary="Pair this device by the token of a link or a PIN"
)
async def pair(request: Request, response: Response, body: Annotated[PairRequest, Body()]) -> Me:
    access = services(request).access
    if access.is_open:
        return _me(principal_of(request))
    if (body.token is None) == (body.pin is None):
        raise HTTPException(422, "Either a token or a PIN lets a device in.")
    peer = request.client.host if request.client is not None else ""
    try:
        device, secret = await access.pair(token=body.token, pin=body.pin, name=body.name, peer=peer)
    except NotPaired as why:
        raise _not_paired(why) from None
    except OSError as why:
        raise HTTPException(503, f"{_NOT_KEPT}: {why.strerror or why}.") from None
    host = request.headers.get("host", "")
    cookie = access.cookie(device, secret, scheme=request.url.scheme, host=host)
    response.headers.append("Set-Cookie", cookie)
    return Me(id=device.id, name=device.name, role=device.role)


def _not_paired(why: NotPaired) -> Problem:
    more: dict[str, Any] = {"code": why.code}
    if not why.wait_s:
        return Problem(403, str(why), **more)
    found = Problem(429 if why.code == "wait" else 403, str(why), **more, wait_s=round(why.wait_s, 1))
    found.headers = {"Retry-After": str(int(why.wait_s) + 1)}
    return found


@router.get("/api/me", tags=["access"], summary="The identity of the caller")
async def me(request: Request) -> Me:
    return _me(principal_of(request))


@router.post("/api/ticket", tags=["access"], summary="A ticket for one socket, within 5 s: /ws?ticket=…")
async def ticket(request: Request) -> Ticket:
    return Ticket(ticket=services(request).access.ticket(principal_of(request)))


@router.get("/api/devices", tags=["access"], summary="The paired devices, newest first")
async def devices(request: Request) -> DeviceList:
    access = services(request).access
    return {
        "you": principal_of(request).id,
        "open": access.is_open,
        "devices": [_listed(request, device) for device in access.devices.all()],
    }


@router.post(
    "/api/devices/invite", responses=raises(409), tags=["access"], summary="A link and a PIN for one more device"
)
async def invite(request: Request, body: Annotated[InviteRequest, Body()]) -> Invited:
    access = services(request).access
    if access.is_open:
        raise HTTPException(409, "This server accepts its own machine only, without pairing. Start it with --host.")
    made = access.another(body.role)
    link = f"{_base(request)}#pair={made.token}"
    code = segno.make(link, error="m", micro=False).svg_data_uri(border=4, dark="#000", light="#fff", omitsize=True)
    return Invited(role=made.role, pin=made.pin, link=link, qr=code, expires_in_s=LASTS_S)


@router.patch(
    "/api/devices/{id}", responses=raises(404, 503), tags=["access"], summary="Another role or name; it counts at once"
)
async def change(request: Request, id: DeviceId, body: Annotated[DeviceChange, Body()]) -> DeviceRow:
    try:
        device = await services(request).access.change(id, role=body.role, name=body.name, but=asyncio.current_task())
    except OSError as why:
        raise HTTPException(503, f"{_NOT_KEPT}: {why.strerror or why}.") from None
    return _listed(request, _there(device))


@router.delete(
    "/api/devices/{id}",
    responses=raises(404, 503),
    tags=["access"],
    summary="It may not come any more, and what it has open ends now",
)
async def remove(request: Request, id: DeviceId) -> Done:
    access = services(request).access
    who = principal_of(request)
    try:
        _there(await access.remove(id, by="itself" if who.id == id else who.name, but=asyncio.current_task()))
    except OSError as why:
        detail = f"Its access ended, but it returns after a restart. {_NOT_KEPT}: {why.strerror or why}."
        raise HTTPException(503, detail) from None
    return Done()


def _there(device: Device | None) -> Device:
    if device is None:
        raise HTTPException(404, "No such device is paired.")
    return device


def _listed(request: Request, device: Device) -> DeviceRow:
    return {
        "id": device.id,
        "name": device.name,
        "role": "operator" if device.role is Role.OPERATOR else "viewer",
        "paired_ms": device.paired_ms,
        "seen_ms": device.seen_ms,
        "sockets": services(request).access.visits.sockets(device.id),  # pages it has open now
    }


def _base(request: Request) -> str:
    """Where another device reaches this server: as this one does, or as it was announced where this one is the
    server's own machine."""
    host = request.headers.get("host", "")
    name = host.partition(":")[0] if not host.startswith("[") else host.partition("]")[0][1:]
    announced = services(request).access.address
    if is_loopback(name) and announced is not None:
        return announced
    access = services(request).access
    return f"{'https' if access.is_secure(request.url.scheme, host) else 'http'}://{host}/"
