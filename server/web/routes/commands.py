"""The commands that are served over HTTP as well: one route for each model that has a summary."""

from __future__ import annotations

import re
from inspect import Parameter, Signature
from typing import Annotated, Any

from fastapi import APIRouter, Body, Path, Request
from pydantic import BaseModel, ConfigDict, create_model

from server.protocol.command_base import OF_PAGE, OfCar
from server.protocol.commands import BY_KIND, SLOW_DOWN, Command
from server.web.routes.session_request import OF_VEHICLE, Done, MeantVehicle, VehicleName, ask, meant_vehicle

router = APIRouter(responses=OF_VEHICLE)


def body_of(command: type[Command], without: tuple[str, ...] = (), *, is_strict: bool = False) -> type[BaseModel]:
    """The body of a command's request: its fields beside `kind`, `id` and those of the path.

    `is_strict`: a text is no number.
    """
    fields: dict[str, Any] = {
        name: (field.annotation, field)
        for name, field in command.model_fields.items()
        if name not in ("kind", "id", *without) and name not in OF_PAGE
    }
    config = ConfigDict(extra="forbid", strict=is_strict)
    return create_model(f"{command.__name__}Request", __config__=config, **fields)


def _add(kind: str, command: type[Command]) -> None:
    path = command.path or f"/api/{kind}"
    in_path = tuple(re.findall(r"{(\w+)}", path))
    body = body_of(command, in_path)
    acts_on_car = issubclass(command, OfCar)

    async def serve(request: Request, vehicle: str | None, **given: Any) -> Done:
        fields = given.pop("body").model_dump() if "body" in given else {}
        if acts_on_car:
            vehicle = meant_vehicle(request, vehicle or fields.get("vehicle"))
        await ask(request, vehicle, {"kind": kind, **fields, **given})
        return Done()

    named: dict[str, Any] = {"request": Request, **dict.fromkeys(in_path, Annotated[str, Path()])}
    if command.has_body and body.model_fields:
        named["body"] = Annotated[body, Body()]
    parameters = [Parameter(name, Parameter.KEYWORD_ONLY, annotation=shape) for name, shape in named.items()]
    which = MeantVehicle if acts_on_car else VehicleName
    parameters.append(Parameter("vehicle", Parameter.KEYWORD_ONLY, annotation=which, default=None))
    # FastAPI reads from here what to pass.
    serve.__signature__ = Signature(parameters, return_annotation=Done)  # type: ignore[attr-defined]
    tag = "slow-down" if kind in SLOW_DOWN else "alarms" if "/alarms/" in path else "vehicle"
    router.add_api_route(path, serve, methods=["POST"], name=kind, summary=command.http, tags=[tag])


for _kind, _command in BY_KIND.items():
    if _command.http:
        _add(_kind, _command)
