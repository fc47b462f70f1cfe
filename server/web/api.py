"""The JSON interface: the state, the connection and the alarms of each vehicle, for pages, tests and scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import orjson
from fastapi import APIRouter, Body, HTTPException, Query, Request, Response, WebSocket
from pydantic import BaseModel, ConfigDict, Field

from server.bus import NotServed

if TYPE_CHECKING:
    from server.app import Running

router = APIRouter()
VehicleName = Annotated[str | None, Query(description="Which vehicle; the first where it is left out", max_length=40)]


class Done(BaseModel):
    """A command was carried out."""

    ok: bool = True


class ConnectRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    address: str = Field(
        max_length=300, examples=["ws://192.168.4.1:9090"], description="host, host:port, ws:// or wss://"
    )


class AcknowledgeRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    occurrence: int = Field(ge=0, le=2**53, description="Which occurrence was seen; an older one is refused")


def running(connection: Request | WebSocket) -> Running:
    found: Running = connection.app.state.running
    return found


def vehicle_of(app: Running, name: str | None) -> str:
    if name is None:
        return next(iter(app.sessions))
    if name not in app.sessions:
        raise HTTPException(404, f"No vehicle is named {name[:40]}.")
    return name


async def ask(request: Request, vehicle: str | None, message: dict[str, Any]) -> dict[str, Any]:
    """The session's answer; refused commands become 409 with the session's sentence."""
    app = running(request)
    try:
        answer = await app.bus.request(vehicle_of(app, vehicle), message)
    except NotServed as why:
        raise HTTPException(503, f"{str(why).capitalize()}.") from None
    if answer.get("ok") is False:
        raise HTTPException(409, str(answer.get("reason")))
    return answer


def _json(body: Any) -> Response:
    return Response(orjson.dumps(body), media_type="application/json")


@router.get("/api/health", tags=["server"], summary="Is the server well?")
async def health(request: Request) -> dict[str, Any]:
    app = running(request)
    return {
        "status": "ok",
        "version": app.version,
        "boot": app.boot,
        "up_for_s": round(app.now() - app.started_s, 1),
        "vehicles": {name: session.phase for name, session in app.sessions.items()},
        "pages": app.hub.pages,
    }


@router.get("/api/vehicles", tags=["vehicle"], summary="The vehicles this server watches, and those found nearby")
async def vehicles(request: Request) -> dict[str, Any]:
    app = running(request)
    return {
        "vehicles": [
            {"name": name, "address": session.address_url, "phase": session.phase}
            for name, session in app.sessions.items()
        ],
        "found": [{"name": vehicle.name, "address": vehicle.address} for vehicle in app.config.found],
    }


@router.get("/api/state", tags=["vehicle"], summary="Everything known of a vehicle now")
async def state(request: Request, vehicle: VehicleName = None) -> Response:
    return _json(await ask(request, vehicle, {"kind": "state"}))


@router.get("/api/signals", tags=["vehicle"], summary="Topics beyond the signals, and what was rejected and why")
async def signals(request: Request, vehicle: VehicleName = None) -> Response:
    return _json(await ask(request, vehicle, {"kind": "signals"}))


@router.get("/api/track", tags=["vehicle"], summary="The track since connecting, as GeoJSON")
async def track(request: Request, vehicle: VehicleName = None) -> Response:
    return _json(await ask(request, vehicle, {"kind": "track"}))


@router.get("/api/events", tags=["alarms"], summary="The numbered log of what happened, oldest first")
async def events(
    request: Request,
    vehicle: VehicleName = None,
    after: Annotated[int, Query(ge=0, le=2**53)] = 0,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> Response:
    app = running(request)
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


@router.post("/api/pause", tags=["vehicle"], summary="Pause monitoring: values go on, no alarm comes")
async def pause(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "pause"})
    return Done()


@router.post("/api/resume", tags=["vehicle"], summary="Monitor again")
async def resume(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "resume"})
    return Done()


@router.websocket("/ws")
async def page_socket(socket: WebSocket, vehicle: str | None = None) -> None:
    """The page's socket; docs/protocol.md."""
    app = running(socket)
    name = vehicle if vehicle is not None else next(iter(app.sessions))
    if name not in app.sessions:
        await socket.close(code=1008, reason="no such vehicle")
        return
    await app.hub.serve(socket, name, app.hello(name))
