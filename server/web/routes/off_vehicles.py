"""Declare a car whose agent is silent off on purpose, over HTTP; only at a web node."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, HTTPException, Request
from fastapi import Path as InPath

from server.access.identity import LOCAL, principal_of
from server.control import display_name
from server.web.interface import raises
from server.web.known_vehicles import MOST_OFF
from server.web.middleware.errors import Problem
from server.web.routes.session_request import NAME_HEADER, Done
from server.web.services import Services, services

router = APIRouter(tags=["vehicle"], responses=raises(404, 409))
Name = Annotated[str, InPath(max_length=40, description="The car's name")]


@router.put("/api/off/{vehicle}", summary="Declare a lost car off on purpose, until it sends data again")
async def off(request: Request, vehicle: Name) -> Done:
    """Refused while its agent sends data."""
    app = _node(request, vehicle)
    if app.bus.trouble(vehicle) is None:
        raise Problem(409, f"{vehicle} sends data: it is not off.")
    if not app.off.declare(vehicle, _by(request)):
        raise Problem(409, f"{MOST_OFF} cars are off on purpose already: declare one of them not off first.")
    return Done()


@router.delete("/api/off/{vehicle}", summary="Declare that a car is not off: it is lost while it sends nothing")
async def not_off(request: Request, vehicle: Name) -> Done:
    _node(request, vehicle).off.withdraw(vehicle, _by(request))
    return Done()


def _node(request: Request, vehicle: str) -> Services:
    app = services(request)
    if app.agents is None:
        raise Problem(409, "Only a web node has cars that are off: disconnect the car instead.")
    if vehicle not in app.vehicles:
        raise HTTPException(404, f"No vehicle is named {vehicle}.")
    return app


def _by(request: Request) -> str:
    who = principal_of(request)
    if who is not LOCAL:
        return who.name
    return display_name.clean(request.headers.get(NAME_HEADER)) or display_name.of_program(
        request.headers.get("user-agent")
    )
