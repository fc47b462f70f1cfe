"""The list of people over HTTP, and who is on duty at the requesting device."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Annotated

from fastapi import APIRouter, Body, HTTPException, Path, Request
from pydantic import BaseModel, ConfigDict, Field

from monitor.runner import Refused
from server.access.identity import LOCAL, principal_of
from server.control import display_name
from server.control.duty import ENDS_WITHIN_H
from server.protocol.people import DutyRole, PeopleList
from server.web.interface import raises
from server.web.middleware.errors import Problem
from server.web.routes.session_request import device_of
from server.web.services import services

router = APIRouter(tags=["people"])
_CHANGES = raises(409, 503)
PersonId = Annotated[str, Path(max_length=60)]
PersonName = Annotated[str, Field(min_length=1, max_length=200, examples=["A. K."])]
_NO_PERSON = "Nobody can be on duty at a program: pair a device, and sign on there."


class NewPerson(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: PersonName
    role: DutyRole = "operator"
    returns: Annotated[bool, Field(description="true: the same person as who was removed under this name")] = False


class PersonChange(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: PersonName | None = None
    role: DutyRole | None = None


class ListChange(BaseModel):
    model_config = ConfigDict(extra="forbid")
    ends_after_h: Annotated[
        float, Field(ge=ENDS_WITHIN_H[0], le=ENDS_WITHIN_H[1], description="A duty ends by itself after so long")
    ]


class SignOn(BaseModel):
    """A person of the list begins their duty at this device."""

    model_config = ConfigDict(extra="forbid")
    person: Annotated[str, Field(min_length=1, max_length=60)]
    role: Annotated[DutyRole | None, Field(description="null: as last time")] = None
    device: Annotated[
        str | None, Field(max_length=200, description="what a page of this machine calls itself; of others not used")
    ] = None
    moves: Annotated[bool, Field(description="true: also where they are on duty at another device, which ends")] = False


@router.get("/api/people", summary="Everybody who can sign on, the last shift first")
async def people(request: Request) -> PeopleList:
    return _listed(request)


@router.post("/api/people", responses=_CHANGES, summary="One more person")
async def add(request: Request, body: Annotated[NewPerson, Body()]) -> PeopleList:
    added = ""

    async def add_person() -> None:
        nonlocal added
        added = await services(request).people.add(body.name, body.role, returns=body.returns)

    listed = await _done(request, add_person())
    return {**listed, "added": added}


@router.patch("/api/people", responses=_CHANGES, summary="After how long a duty ends by itself")
async def change_list(request: Request, body: Annotated[ListChange, Body()]) -> PeopleList:
    return await _done(request, services(request).people.set_hours(body.ends_after_h))


@router.patch("/api/people/{id}", responses=_CHANGES, summary="Another name or role")
async def change(request: Request, id: PersonId, body: Annotated[PersonChange, Body()]) -> PeopleList:
    return await _done(request, services(request).people.change(id, name=body.name, role=body.role))


@router.delete("/api/people/{id}", responses=_CHANGES, summary="Remove a person who is not on duty")
async def remove(request: Request, id: PersonId) -> PeopleList:
    return await _done(request, services(request).people.remove(id))


@router.post("/api/duty", responses=_CHANGES, summary="Sign on at this device")
async def sign_on(request: Request, body: Annotated[SignOn, Body()]) -> PeopleList:
    made = services(request).people.sign_on(
        _device(request), _device_name(request, body.device), body.person, body.role, moves=body.moves
    )
    return await _done(request, made)


@router.delete("/api/duty", responses=_CHANGES, summary="Sign off at this device")
async def sign_off(request: Request) -> PeopleList:
    return await _done(request, services(request).people.sign_off(_device(request)))


@router.delete("/api/duty/note", responses=_CHANGES, summary="The note of how the last duty ended was read")
async def dismiss(request: Request) -> PeopleList:
    return await _done(request, services(request).people.dismiss(_device(request)))


async def _done(request: Request, doing: Awaitable[object]) -> PeopleList:
    """The list as it is then; what is refused becomes 409 with its sentence."""
    try:
        await doing
    except Refused as why:
        raise Problem(409, why.reason) from None
    except OSError as why:
        detail = f"It counts until a restart: it cannot be stored on the server's disk ({why.strerror or why})."
        raise HTTPException(503, detail) from None
    return _listed(request)


def _listed(request: Request) -> PeopleList:
    return services(request).people.listed(device_of(request))


def _device(request: Request) -> str:
    """Raises Problem where nobody can be on duty."""
    found = device_of(request)
    if found is None:
        raise Problem(409, _NO_PERSON)
    return found


def _device_name(request: Request, own: str | None) -> str:
    who = principal_of(request)
    return (display_name.clean(own) if who is LOCAL else None) or who.name
