"""The events and the standing alarms of each vehicle over HTTP, and their acknowledgement."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Body, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from server.web.routes.session_request import Done, VehicleName, as_json, ask, vehicle_of
from server.web.services import services

router = APIRouter(tags=["alarms"])


class AcknowledgeRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    occurrence: int = Field(ge=0, le=2**53, description="Which occurrence was seen; an older one is refused")


@router.get("/api/events", summary="The numbered log of what happened, oldest first")
async def events(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53)] = 0,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> Response:
    app = services(request)
    name = vehicle_of(app, vehicle)
    return as_json({"events": await app.bus.events_after(name, after, limit), "last": app.bus.last_event(name)})


@router.get("/api/alarms", summary="The alarms that stand, most urgent first")
async def alarms(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json({"alarms": (await ask(request, vehicle, {"kind": "state"}))["alarms"]})


@router.post("/api/alarms/{alarm}/acknowledge", summary="The operator has seen this occurrence")
async def acknowledge(
    request: Request, alarm: str, body: Annotated[AcknowledgeRequest, Body()], vehicle: VehicleName = None
) -> Done:
    await ask(request, vehicle, {"kind": "acknowledge", "alarm": alarm, "occurrence": body.occurrence})
    return Done()
