"""Slowing the car over HTTP: the same orders as a page's."""

from __future__ import annotations

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from server.web.routes.session_request import Done, VehicleName, ask

router = APIRouter(tags=["slow-down"])


class ReleaseRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    number: int = Field(ge=0, le=2**53, description="Of the very order that ends, as the state names it")


class VetoRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    trigger: str = Field(max_length=120, description="As the count-down names it")


@router.post("/api/slow-down/arm", summary="Slow-down may be ordered from now on")
async def arm(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "arm"})
    return Done()


@router.post("/api/slow-down/disarm", summary="Nothing can be ordered any more")
async def disarm(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "disarm"})
    return Done()


@router.post("/api/slow-down/order", summary="Slow the car, and hold it until it is released; no emergency stop")
async def order(request: Request, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "slow_down"})
    return Done()


@router.post("/api/slow-down/release", summary="Whoever drives may drive on")
async def release(request: Request, body: ReleaseRequest, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "release", "number": body.number})
    return Done()


@router.post("/api/slow-down/veto", summary="Not slowed by itself this time")
async def veto(request: Request, body: VetoRequest, vehicle: VehicleName = None) -> Done:
    await ask(request, vehicle, {"kind": "veto", "trigger": body.trigger})
    return Done()
