"""The events and the alarms of each vehicle over HTTP, as JSON."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response

from server.protocol.alarm_state import CheckAnswer
from server.protocol.http_answers import AlarmList, EventList
from server.web.routes.session_request import OF_VEHICLE, ReplayToken, VehicleName, as_json, ask, ask_either, vehicle_of
from server.web.services import services

router = APIRouter(tags=["alarms"], responses=OF_VEHICLE)


@router.get("/api/events", response_model=EventList, summary="The numbered log of what happened, oldest first")
async def events(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53)] = 0,
    run: Annotated[str | None, Query(max_length=40, description="In which `after` was read; none: the present")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> Response:
    """Numbers are of the `run` in the answer. Who read up to `after` in another run gets what follows the common part;
    events up to `new_after` may be known from there."""
    app = services(request)
    name = vehicle_of(app, vehicle)
    present = app.bus.run(name)
    body: dict[str, Any] = {"run": present}
    if run is not None and run != present:
        resumed = await app.bus.resume(name, run, after)
        after, body["resumed"] = resumed.after, {"common": resumed.common, "new_after": resumed.new_after}
    body["events"] = await app.bus.events_after(name, after, limit)
    return as_json(body | {"last": app.bus.last_event(name)})


@router.get(
    "/api/alarms", response_model=AlarmList, summary="The alarms that are active or not acknowledged, most urgent first"
)
async def alarms(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json({"alarms": (await ask(request, vehicle, {"kind": "state"}))["alarms"]})


@router.get(
    "/api/checks/{check}",
    response_model=CheckAnswer,
    summary="One check: what it found, its last minute, its thresholds, what it needs",
)
async def check(
    request: Request,
    check: Annotated[str, Path(max_length=120)],
    vehicle: VehicleName = None,
    replay: ReplayToken = None,
) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "check", "check": check}))
