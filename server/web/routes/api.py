"""The JSON interface: the state, the connection and the alarms of each vehicle, for pages, tests and scripts."""

from __future__ import annotations

from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Body, HTTPException, Query, Request, Response, WebSocket
from pydantic import BaseModel, ConfigDict, Field

from server.access.identity import is_known, who_of
from server.bus.bus import NotServed
from server.control import display_name
from server.replay import commands
from server.replay.manager import NoReplay
from server.web.middleware.errors import Problem
from server.web.services import Services, services

router = APIRouter()
NAME_HEADER = "x-catgraph-name"  # what the caller wants to be called in the log
FENCE_HEADER = "x-catgraph-fence"  # the number of the lease of control by which a page orders
VehicleName = Annotated[str | None, Query(description="Which vehicle; the first where it is left out", max_length=40)]
ReplayToken = Annotated[str | None, Query(description="Of a page's replay, as its state names it", max_length=40)]


class Done(BaseModel):
    """A command was carried out."""

    ok: bool = True


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


class AcknowledgeRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    occurrence: int = Field(ge=0, le=2**53, description="Which occurrence was seen; an older one is refused")


def vehicle_of(app: Services, name: str | None) -> str:
    if name is None:
        return next(iter(app.sessions))
    if name not in app.sessions:
        raise HTTPException(404, f"No vehicle is named {name[:40]}.")
    return name


async def ask(request: Request, vehicle: str | None, message: dict[str, Any]) -> dict[str, Any]:
    """The session's answer; refused commands become 409 with the session's sentence.

    Who gave the order is in the log as the header X-Catgraph-Name has it, else as "api" and the program's name.
    """
    app = services(request)
    by = display_name.clean(request.headers.get(NAME_HEADER)) or display_name.of_program(
        request.headers.get("user-agent")
    )
    try:
        answer = await app.bus.request(vehicle_of(app, vehicle), message | _sender(request) | {"by": by})
    except NotServed as why:
        raise HTTPException(503, f"{str(why).capitalize()}.") from None
    if answer.get("ok") is False:
        more = {name: value for name, value in answer.items() if name not in ("ok", "reason")}
        raise Problem(422 if "field" in answer else 409, str(answer.get("reason")), **more)
    return answer


def _sender(request: Request) -> dict[str, Any]:
    """Who sent a request, and by which lease of control: a number, where it gives one."""
    fence = request.headers.get(FENCE_HEADER, "")
    return {
        "who": who_of(request).id,
        "page": None,
        "fence": int(fence) if fence.isascii() and fence.isdigit() and len(fence) < 16 else None,
        "console": services(request).is_open,
    }


async def _ask_either(
    request: Request, vehicle: str | None, replay: str | None, message: dict[str, Any]
) -> dict[str, Any]:
    """What is asked of the live car, or of one page's replay."""
    if replay is None:
        return await ask(request, vehicle, message)
    try:
        return await services(request).desk.by_token(replay).ask(message)
    except NoReplay as why:
        raise HTTPException(404, str(why)) from None


def _json(body: Any) -> Response:
    return Response(orjson.dumps(body), media_type="application/json")


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
    return _json(await ask(request, vehicle, {"kind": "state"}))


@router.get("/api/signals", tags=["vehicle"], summary="Topics for each signal and beyond, what was rejected and why")
async def signals(request: Request, vehicle: VehicleName = None) -> Response:
    return _json(await ask(request, vehicle, {"kind": "signals"}))


@router.get("/api/track", tags=["vehicle"], summary="The track since connecting, as GeoJSON")
async def track(request: Request, vehicle: VehicleName = None) -> Response:
    return _json(await ask(request, vehicle, {"kind": "track"}))


@router.get("/api/track/points", tags=["vehicle"], summary="The track's points beyond one, with their numbers")
async def track_points(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53, description="Only points with greater numbers")] = 0,
    replay: ReplayToken = None,
) -> Response:
    return _json(await _ask_either(request, vehicle, replay, {"kind": "track_points", "after": after}))


@router.get("/api/trends", tags=["vehicle"], summary="The last minute of speed, pedals, steering and distance")
async def trends(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int | None, Query(ge=0, le=2**53, description="Only the steps after this one")] = None,
    replay: ReplayToken = None,
) -> Response:
    return _json(await _ask_either(request, vehicle, replay, {"kind": "trends", "after": after}))


@router.get("/api/events", tags=["alarms"], summary="The numbered log of what happened, oldest first")
async def events(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53)] = 0,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> Response:
    app = services(request)
    name = vehicle_of(app, vehicle)
    return _json({"events": app.bus.events_after(name, after, limit), "last": app.bus.last_event(name)})


@router.get("/api/alarms", tags=["alarms"], summary="The alarms that stand, most urgent first")
async def alarms(request: Request, vehicle: VehicleName = None) -> Response:
    return _json({"alarms": (await ask(request, vehicle, {"kind": "state"}))["alarms"]})


@router.post("/api/alarms/{alarm}/acknowledge", tags=["alarms"], summary="The operator has seen this occurrence")
async def acknowledge(
    request: Request, alarm: str, body: Annotated[AcknowledgeRequest, Body()], vehicle: VehicleName = None
) -> Done:
    await ask(request, vehicle, {"kind": "acknowledge", "alarm": alarm, "occurrence": body.occurrence})
    return Done()


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


class SettingsChange(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    values: dict[str, float | None] = Field(
        default_factory=dict,
        examples=[{"speed_limit.max_mps": 9.0}],
        description="In SI; null goes back to the default",
    )
    topics: dict[str, str | None] = Field(default_factory=dict, description="Signal → topic; null: as found")
    profile: str | None = Field(None, description="A profile's name, or auto")
    version: int | None = Field(None, description="Refused with 409 when the settings are no longer at this version")


@router.get("/api/settings", tags=["settings"], summary="Settings in force, their defaults, ranges and units")
async def settings(request: Request, vehicle: VehicleName = None) -> Response:
    body = await ask(request, vehicle, {"kind": "settings"})
    return _json({name: value for name, value in body.items() if name != "toml"})


@router.patch("/api/settings", tags=["settings"], summary="Change some settings; they count at once")
async def change_settings(
    request: Request, body: Annotated[SettingsChange, Body()], vehicle: VehicleName = None
) -> Response:
    await ask(request, vehicle, {"kind": "set", **body.model_dump()})
    return await settings(request, vehicle)


@router.get("/api/settings.toml", tags=["settings"], summary="What was changed, as a TOML file")
async def export_settings(request: Request, vehicle: VehicleName = None) -> Response:
    body = await ask(request, vehicle, {"kind": "settings"})
    name = f"catgraph-{vehicle_of(services(request), vehicle)}.toml"
    return Response(
        body["toml"],
        media_type="application/toml; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.put("/api/settings.toml", tags=["settings"], summary="Take all settings from a TOML file")
async def import_settings(request: Request, vehicle: VehicleName = None) -> Response:
    try:
        text = (await limited_body(request, 64 * 1024)).decode("utf-8")
    except UnicodeDecodeError:
        raise HTTPException(422, "This is not text in UTF-8.") from None
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


@router.websocket("/ws")
async def page_socket(
    socket: WebSocket, vehicle: str | None = None, replay: str | None = None, t: str | None = None
) -> None:
    """The page's socket; docs/protocol.md. `replay`: the recording it begins with, `t` seconds after its beginning."""
    app = services(socket)
    name = vehicle if vehicle is not None else next(iter(app.sessions))
    if name not in app.sessions:
        await socket.close(code=1008, reason="no such vehicle")
        return
    who = who_of(socket)
    hello = app.hello(name) | {"who": {"id": who.id, "name": who.name, "role": who.role}}
    await app.hub.serve(socket, name, hello, who=who, replay=commands.opening(replay, t))
