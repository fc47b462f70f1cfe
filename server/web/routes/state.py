"""The state of the server and of each vehicle over HTTP."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Query, Request, Response

from monitor.signals import CHARTED
from server.access.identity import is_known
from server.protocol.drive_trends import LEAST_BUCKETS, MOST_BUCKETS, MOST_SIGNALS
from server.web.middleware.errors import Problem
from server.web.routes.session_request import ReplayToken, VehicleName, as_json, ask, ask_either
from server.web.services import Services, services

router = APIRouter()
COUNTED_WITHIN_S = 2.0  # a health check must work while the disk hangs


@router.get("/api/health", tags=["server"], summary="Is the server well?")
async def health(request: Request) -> Response:
    """200 and "ok", or 503 and "impaired" with the problems. A caller who is not known gets status and version only."""
    app = services(request)
    found = app.problems()
    recordings = await _counted(app, found) if is_known(request) else None
    body: dict[str, Any] = {"status": "impaired" if found else "ok", "version": app.version}
    if is_known(request):
        body |= {
            "problems": found,
            "boot": app.boot,
            "up_for_s": round(app.now() - app.started_s, 1),
            "vehicles": {name: session.phase for name, session in app.sessions.items()},
            "pages": app.hub.pages,
            "recordings": recordings,
        }
    return Response(orjson.dumps(body), status_code=503 if found else 200, media_type="application/json")


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


@router.get(
    "/api/trends/drive", tags=["vehicle"], summary="Signals over the whole drive, lowest and highest in buckets"
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
