"""The state of the server and of each vehicle over HTTP, and the commands of a connection."""

from __future__ import annotations

from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Body, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from server.access.identity import is_known
from server.web.routes.session_request import Done, ReplayToken, VehicleName, as_json, ask, ask_either
from server.web.services import services

router = APIRouter()


class ConnectRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    address: str = Field(
        default="",
        max_length=300,
        examples=["ws://192.168.4.1:9090"],
        description="host, host:port, ws:// or wss://; empty: the car that was configured",
    )


class RecordRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    on: bool = Field(description="true begins a recording, false ends the one that is made")


@router.get("/api/health", tags=["server"], summary="Is the server well?")
async def health(request: Request) -> Response:
    """200 and "ok", or 503 and "impaired" with the problems. A caller who is not known gets status and version only."""
    app = services(request)
    found = app.problems()
    body: dict[str, Any] = {"status": "impaired" if found else "ok", "version": app.version}
    if is_known(request):
        body |= {
            "problems": found,
            "boot": app.boot,
            "up_for_s": round(app.now() - app.started_s, 1),
            "vehicles": {name: session.phase for name, session in app.sessions.items()},
            "pages": app.hub.pages,
            "recordings": None
            if app.recordings is None
            else app.recordings.totals() | {"unread": app.recordings.waiting},
        }
    return Response(orjson.dumps(body), status_code=503 if found else 200, media_type="application/json")


@router.get("/api/vehicles", tags=["vehicle"], summary="The vehicles this server watches, and those found nearby")
async def vehicles(request: Request) -> dict[str, Any]:
    app = services(request)
    return {
        "vehicles": [
            {"name": name, "address": session.address_url or session.configured, "phase": session.phase}
            for name, session in app.sessions.items()
        ],
        "found": [{"name": vehicle.name, "address": vehicle.address} for vehicle in app.found],
    }


@router.get("/api/state", tags=["vehicle"], summary="Everything known of a vehicle now")
async def state(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "state"}))


@router.get("/api/signals", tags=["vehicle"], summary="Topics for each signal and beyond, what was rejected and why")
async def signals(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "signals"}))


@router.get("/api/track", tags=["vehicle"], summary="The track since connecting, as GeoJSON")
async def track(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "track"}))


@router.get("/api/track/points", tags=["vehicle"], summary="The track's points beyond one, with their numbers")
async def track_points(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53, description="Only points with greater numbers")] = 0,
    replay: ReplayToken = None,
) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "track_points", "after": after}))


@router.get("/api/trends", tags=["vehicle"], summary="The last minute of speed, pedals, steering and distance")
async def trends(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int | None, Query(ge=0, le=2**53, description="Only the steps after this one")] = None,
    replay: ReplayToken = None,
) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "trends", "after": after}))


@router.post("/api/connect", tags=["vehicle"], summary="Dial a car's rosbridge; it is tried until disconnected")
async def connect(request: Request, body: Annotated[ConnectRequest, Body()], vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "connect", "address": body.address})
    return Done()


@router.post("/api/disconnect", tags=["vehicle"], summary="End monitoring")
async def disconnect(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "disconnect"})
    return Done()


@router.post("/api/record", tags=["vehicle"], summary="Begin to record, or end it, by hand")
async def record(request: Request, body: RecordRequest, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "record", "on": body.on})
    return Done()


@router.post("/api/pause", tags=["vehicle"], summary="Pause monitoring: values go on, no alarm comes")
async def pause(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "pause"})
    return Done()


@router.post("/api/resume", tags=["vehicle"], summary="Monitor again")
async def resume(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "resume"})
    return Done()
