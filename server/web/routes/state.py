"""The state of the server and of each vehicle over HTTP."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Path, Query, Request, Response

from monitor.signals import CHARTED
from server.access.identity import is_known
from server.bus.bus import NotServed
from server.protocol.answers import SignalsAnswer, TrackPoints
from server.protocol.departure import DepartureAnswer
from server.protocol.drive_trends import LEAST_BUCKETS, MOST_BUCKETS, MOST_SIGNALS, DriveTrendsAnswer
from server.protocol.driving_state import DrivingAnswer, InterventionAnswer
from server.protocol.http_answers import Health, Track, VehicleList, VehicleRow
from server.protocol.state import LiveState, Trends
from server.web.interface import files
from server.web.middleware.errors import Problem
from server.web.routes.session_request import (
    OF_VEHICLE,
    TOML,
    ReplayToken,
    VehicleName,
    as_json,
    as_toml,
    ask,
    ask_either,
    vehicle_of,
)
from server.web.services import Services, services

router = APIRouter()
of_vehicle = APIRouter(tags=["vehicle"], responses=OF_VEHICLE)
AGENT_WITHIN_S = 1.0  # an agent that has not answered then is called lost
COUNTED_WITHIN_S = 2.0  # a health check must work while the disk hangs


@router.get(
    "/api/health",
    response_model=Health,
    responses={503: {"model": Health, "description": "Impaired"}},
    tags=["server"],
    summary="Is the server well?",
)
async def health(request: Request) -> Response:
    """200 and "ok"; 200 and "cars lost" where the server is well and cars send nothing, because another server would
    not receive anything either; 503 and "impaired" with the problems.

    A caller who is not known gets status and version only.
    """
    app = services(request)
    found, lost = app.problems(), app.lost()
    recordings = await _counted(app, found) if is_known(request) else None
    status = "impaired" if found else "cars lost" if lost else "ok"
    body: dict[str, Any] = {"status": status, "version": app.version}
    if is_known(request):
        body |= {
            "problems": found,
            "lost": lost,
            "off": sorted(app.off.names),
            "boot": app.boot,
            "up_for_s": round(app.now() - app.started_s, 1),
            "vehicles": {one["name"]: one["phase"] for one in await _listed(app)},
            "pages": app.hub.pages,
            "recordings": recordings,
        }
    return Response(orjson.dumps(body), status_code=503 if found else 200, media_type="application/json")


async def _listed(app: Services) -> list[VehicleRow]:
    """Name, address and phase of each vehicle; one whose agent does not answer is lost."""

    async def one(name: str) -> VehicleRow:
        session = app.sessions.get(name)
        if session is not None:
            return {"name": name, "address": session.address_url or session.configured, "phase": session.phase}
        try:
            remote = (await app.bus.request(name, {"kind": "state"}, deadline_s=AGENT_WITHIN_S))["session"]
            return {"name": name, "address": remote["address"], "phase": remote["phase"]}
        except (NotServed, KeyError, TypeError):
            return {"name": name, "address": None, "phase": "lost"}

    return list(await asyncio.gather(*map(one, app.vehicles)))


async def _counted(app: Services, problems: list[str]) -> Mapping[str, object] | None:
    """The number of recordings; None: nothing is stored, or the disk does not answer, which is a problem."""
    recordings = app.recordings
    if recordings is None:
        return None
    try:
        async with asyncio.timeout(COUNTED_WITHIN_S):
            return await app.storage.run(lambda: {"unread": recordings.waiting, **recordings.totals()})
    except TimeoutError:
        problems.append(f"The disk has not counted the recordings within {COUNTED_WITHIN_S:g} s.")
        return None


@router.get("/api/vehicles", tags=["vehicle"], summary="The vehicles this server watches, and those found nearby")
async def vehicles(request: Request) -> VehicleList:
    app = services(request)
    return {
        "vehicles": await _listed(app),
        "found": [{"name": vehicle.name, "address": vehicle.address} for vehicle in app.found],
    }


@of_vehicle.get(
    "/api/state",
    response_model=LiveState,
    summary="Everything known of a vehicle now",
)
async def state(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "state"}))


@of_vehicle.get(
    "/api/signals",
    response_model=SignalsAnswer,
    summary="Topics for each signal and beyond, what was rejected and why",
)
async def signals(request: Request, vehicle: VehicleName = None, replay: ReplayToken = None) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "signals"}))


@of_vehicle.get(
    "/api/driving",
    response_model=DrivingAnswer,
    summary="Time and distance in each mode, interventions and alarms a km",
)
async def driving(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "driving"}))


@of_vehicle.get(
    "/api/interventions/{intervention}",
    response_model=InterventionAnswer,
    summary="One intervention, with the 16 s about it",
)
async def intervention(
    request: Request, intervention: Annotated[str, Path(max_length=40)], vehicle: VehicleName = None
) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "intervention", "intervention": intervention}))


@of_vehicle.get(
    "/api/departure",
    response_model=DepartureAnswer,
    summary="The departure check: its list, what became of it, who signed",
)
async def departure(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "departure"}))


@of_vehicle.get(
    "/api/departure.toml",
    response_class=Response,
    responses=files(TOML),
    summary="The list of the departure check, as a TOML file",
)
async def departure_list(request: Request, vehicle: VehicleName = None) -> Response:
    body = await ask(request, vehicle, {"kind": "departure"})
    return as_toml(body["toml"], f"{vehicle_of(services(request), vehicle)}.departure.toml")


@of_vehicle.get(
    "/api/track",
    response_model=Track,
    summary="The track since connecting, as GeoJSON",
)
async def track(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "track"}))


@of_vehicle.get(
    "/api/track/points",
    response_model=TrackPoints,
    summary="The track's points beyond one, with their numbers",
)
async def track_points(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53, description="Only points with greater numbers")] = 0,
    replay: ReplayToken = None,
) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "track_points", "after": after}))


@of_vehicle.get(
    "/api/trends",
    response_model=Trends,
    summary="The last minute of speed, pedals, steering and distance",
)
async def trends(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int | None, Query(ge=0, le=2**53, description="Only the steps after this one")] = None,
    replay: ReplayToken = None,
) -> Response:
    return as_json(await ask_either(request, vehicle, replay, {"kind": "trends", "after": after}))


@of_vehicle.get(
    "/api/trends/drive",
    response_model=DriveTrendsAnswer,
    summary="Signals over the whole drive, lowest and highest in buckets",
)
async def drive_trends(
    request: Request,
    vehicle: VehicleName = None,
    signals: Annotated[str, Query(max_length=200, description="At most four names, separated by commas")] = "speed",
    from_s: Annotated[float, Query(ge=0, le=1e7, allow_inf_nan=False, description="Since the drive began")] = 0.0,
    to_s: Annotated[
        float | None, Query(ge=0, le=1e7, allow_inf_nan=False, description="Left out: up to now, or to the end")
    ] = None,
    buckets: Annotated[int, Query(ge=LEAST_BUCKETS, le=MOST_BUCKETS, description="At most about so many")] = 300,
    replay: ReplayToken = None,
) -> Response:
    names = list(dict.fromkeys(signals.split(",")))
    for name in names:
        if name not in CHARTED:
            raise Problem(422, f"No signal is named {name[:40]!r}: choose among {', '.join(CHARTED)}.", field="signals")
    if len(names) > MOST_SIGNALS:
        raise Problem(422, f"At most {MOST_SIGNALS} signals at a time.", field="signals")
    if to_s is not None and to_s < from_s:
        raise Problem(422, "The range ends before it begins.", field="to_s")
    wanted = {"signals": names, "from_s": from_s, "to_s": to_s, "buckets": buckets}
    return as_json(await ask_either(request, vehicle, replay, {"kind": "drive_trends", **wanted}))


router.include_router(of_vehicle)
