"""What the routes of one vehicle share: which vehicle is meant, and its session's answer over the bus."""

from __future__ import annotations

import base64
import logging
import re
from collections.abc import Mapping
from typing import Annotated, Any

import orjson
from fastapi import HTTPException, Query, Request, Response
from pydantic import BaseModel

from server.access.identity import principal_of
from server.access.people import device_key
from server.bus.bus import NotServed
from server.control import display_name
from server.protocol import commands, messages
from server.protocol.command_base import PAGE
from server.replay.manager import NoReplay
from server.system import log_context
from server.web.interface import raises
from server.web.middleware.errors import Problem
from server.web.services import Services, services

log = logging.getLogger("catgraph.web")

NAME_HEADER = "x-catgraph-name"  # what the caller wants to be called in the log
TRACE_HEADER = "x-catgraph-trace"  # the id of the command in the logs; one is made where it is left out
SIGNED_HEADER = "x-catgraph-signed"  # the command, signed by the program's own key: base64 of JSON
PAGE_HEADER = "x-catgraph-page"  # of a page of this machine: which one, as its hello states
FENCE_HEADER = "x-catgraph-fence"  # the number of the lease of control by which a page orders
VehicleName = Annotated[str | None, Query(description="Which vehicle; the first where it is left out", max_length=40)]
MeantVehicle = Annotated[
    str | None, Query(description="Which vehicle; required where there are several", max_length=40)
]
TOML = "application/toml"
OF_VEHICLE = raises(404, 409, 422, 503)  # of a route that sends a request to a session, as `ask` raises them
ReplayToken = Annotated[str | None, Query(description="Of a page's replay, as its state names it", max_length=40)]


class Done(BaseModel):
    """A command was carried out."""

    ok: bool = True


def vehicle_of(app: Services, name: str | None) -> str:
    if not app.vehicles:
        raise HTTPException(503, "No vehicle has connected to the broker yet.")
    if name is None:
        return app.vehicles[0]
    if name not in app.vehicles:
        raise HTTPException(404, f"No vehicle is named {name[:40]}.")
    return name


def meant_vehicle(request: Request, name: str | None) -> str | None:
    """The vehicle that a command acts on: it must be named where there are several."""
    app = services(request)
    names = app.vehicles
    if name is None and (len(names) > 1 or app.bus.grows):  # some cars of a web node may not have sent anything yet
        raise HTTPException(
            422, f"This server has several cars: name the one that is meant by ?vehicle= ({', '.join(names)})."
        )
    return name


async def ask(request: Request, vehicle: str | None, message: dict[str, Any]) -> Mapping[str, Any]:
    """The session's answer; refused commands become 409 with the session's sentence.

    Who gave the order is in the log as the header X-Catgraph-Name has it, else as "api" and the program's name.
    """
    app = services(request)
    sender = sent_by(request)
    sent, by = message | _signed(request) | sender, sender["by"]
    is_order = request.method not in ("GET", "HEAD")
    try:
        with log_context.tracing(request.headers.get(TRACE_HEADER)):
            answer = await app.bus.request(vehicle_of(app, vehicle), sent, comes_within_s=commands.comes_within_s(sent))
            if is_order and app.bus.grows:  # else the session has logged it
                log.info("command_passed_on kind=%s by=%s ok=%s", message.get("kind"), by, answer.get("ok", True))
    except NotServed as why:
        if not is_order:
            raise
        found = messages.not_served(why)
        raise Problem(503, str(found["reason"]), outcome=why.outcome, cut=why.cut) from None
    if answer.get("ok") is False:
        more = {name: value for name, value in answer.items() if name not in ("ok", "reason")}
        raise Problem(422 if "field" in answer else 409, str(answer.get("reason")), **more)
    return answer


def sent_by(request: Request) -> dict[str, Any]:
    """The sender of a request, as the session gets it."""
    by = display_name.clean(request.headers.get(NAME_HEADER)) or display_name.of_program(
        request.headers.get("user-agent")
    )
    return _sender(request) | {"by": by}


def _signed(request: Request) -> dict[str, Any]:
    """The signed command of a request, for the agent that carries it out."""
    text = request.headers.get(SIGNED_HEADER)
    if text is None:
        return {}
    try:
        return {"signed": orjson.loads(base64.b64decode(text, validate=True))}
    except ValueError:
        raise HTTPException(422, "The header X-Catgraph-Signed is no base64 of JSON.") from None


def _sender(request: Request) -> dict[str, Any]:
    """Who sent a request, and by which lease of control: a number, where it gives one."""
    fence = request.headers.get(FENCE_HEADER, "")
    return {
        "who": principal_of(request).id,
        **services(request).people.sent(device_of(request)),
        "page": None,
        "fence": int(fence) if fence.isascii() and fence.isdigit() and len(fence) < 16 else None,
        "console": services(request).is_open,
    }


def device_of(request: Request) -> str | None:
    """The key under which somebody is on duty at the device that sent a request; None: nobody can be."""
    page = request.headers.get(PAGE_HEADER, "")
    return device_key(principal_of(request), page if re.fullmatch(PAGE, page) else None)


async def ask_either(
    request: Request, vehicle: str | None, replay: str | None, message: dict[str, Any]
) -> Mapping[str, Any]:
    """Requests to the live car or to a page's replay."""
    if replay is None:
        return await ask(request, vehicle, message)
    try:
        return await services(request).replays.by_token(replay).ask(message)
    except NoReplay as why:
        raise HTTPException(404, str(why)) from None


def as_json(body: Any) -> Response:
    return Response(orjson.dumps(body), media_type="application/json")


def as_toml(text: str, name: str) -> Response:
    """A file of this name to keep."""
    return Response(
        text,
        media_type=f"{TOML}; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )
