"""What the routes of one vehicle share: which vehicle is meant, and its session's answer over the bus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import orjson
from fastapi import HTTPException, Query, Request, Response
from pydantic import BaseModel

from server.access.identity import principal_of
from server.bus.bus import NotServed
from server.control import display_name
from server.replay.manager import NoReplay
from server.web.middleware.errors import Problem
from server.web.services import Services, services

NAME_HEADER = "x-catgraph-name"  # what the caller wants to be called in the log
FENCE_HEADER = "x-catgraph-fence"  # the number of the lease of control by which a page orders
VehicleName = Annotated[str | None, Query(description="Which vehicle; the first where it is left out", max_length=40)]
MeantVehicle = Annotated[
    str | None, Query(description="Which vehicle; required where there are several", max_length=40)
]
ReplayToken = Annotated[str | None, Query(description="Of a page's replay, as its state names it", max_length=40)]


class Done(BaseModel):
    """A command was carried out."""

    ok: bool = True


def vehicle_of(app: Services, name: str | None) -> str:
    if name is None:
        return next(iter(app.sessions))
    if name not in app.sessions:
        raise HTTPException(404, f"No vehicle is named {name[:40]}.")
    return name


def meant_vehicle(request: Request, name: str | None) -> str | None:
    """The vehicle that a command acts on: it must be named where there are several."""
    names = services(request).sessions
    if name is None and len(names) > 1:
        raise HTTPException(
            422, f"This server has several cars: name the one that is meant by ?vehicle= ({', '.join(names)})."
        )
    return name


async def ask(request: Request, vehicle: str | None, message: dict[str, Any]) -> Mapping[str, Any]:
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
        "who": principal_of(request).id,
        "page": None,
        "fence": int(fence) if fence.isascii() and fence.isdigit() and len(fence) < 16 else None,
        "console": services(request).is_open,
    }


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
