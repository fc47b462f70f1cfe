"""The map layers over HTTP: fetched tiles, map files, site image."""

from __future__ import annotations

import re
from typing import Any

from fastapi import APIRouter, HTTPException, Request, Response
from starlette.concurrency import run_in_threadpool

from server.protocol.http_answers import MapAnswer
from server.web.interface import files, raises
from server.web.maps.image_type import TYPES
from server.web.maps.mbtiles import Layer
from server.web.maps.tile_proxy import Upstream
from server.web.services import services

router = APIRouter()
_YEAR = "public, max-age=31536000, immutable"  # a file with other content has another name
_DAY_S = 86_400  # a phone keeps a fetched tile no longer: it may be another one by then
_NUMBER = re.compile(r"[0-9]{1,9}")  # more digits are no tile's, and turning them into a number may cost or fail


@router.get(
    "/api/map",
    response_model=MapAnswer,
    tags=["map"],
    summary="The layers below the map: tiles, and the image of the site",
)
async def ground(request: Request) -> dict[str, Any]:
    under = services(request).ground
    image, fetched = under.image, under.upstream
    layers = [] if fetched is None else [_description(fetched.layer) | {"upstream": fetched.description()}]
    return {
        "layers": [*layers, *(_description(one.layer) for one in under.maps.values())],
        "image": image
        and {"source": f"/map/site/{image.name}", "corners": image.corners, "attribution": image.attribution},
    }


def _description(layer: Layer) -> dict[str, Any]:
    return {
        "title": layer.title,
        "tiles": f"/map/{layer.name}/{{z}}/{{x}}/{{y}}",
        "min_zoom": layer.zoom[0],
        "max_zoom": layer.zoom[1],
        "bounds": layer.bounds,
        "attribution": layer.attribution,
    }


@router.get(
    "/map/site/{name}",
    responses=files(*TYPES) | raises(404),
    tags=["map"],
    summary="The picture of the site",
    response_class=Response,
)
async def picture(request: Request, name: str) -> Response:
    image = services(request).ground.image
    if image is None or name != image.name:
        raise HTTPException(404, "There is no such picture.")
    return Response(image.data, media_type=image.media_type, headers={"Cache-Control": _YEAR})


@router.get(
    "/map/{name}/{z}/{x}/{y}",
    responses=files(*TYPES) | {204: {"description": "No tile"}} | raises(404),
    tags=["map"],
    summary="A tile, rows counted from the north; 204 where the map has none",
    response_class=Response,
)
async def tile(request: Request, name: str, z: str, x: str, y: str) -> Response:
    under = services(request).ground
    found = under.maps.get(name)
    fetched = under.upstream if under.upstream is not None and under.upstream.layer.name == name else None
    if (found is None and fetched is None) or not all(_NUMBER.fullmatch(number) for number in (z, x, y)):
        raise HTTPException(404, "There is no such tile.")
    if found is None and fetched is not None:
        return await _fetched(fetched, int(z), int(x), int(y))
    assert found is not None
    # In a thread, because a file may be on a slow disk.
    picture = await run_in_threadpool(found.tile, int(z), int(x), int(y))
    if picture is None:
        return Response(status_code=204, headers={"Cache-Control": "public, max-age=3600"})
    return Response(picture[0], media_type=picture[1], headers={"Cache-Control": _YEAR})


async def _fetched(layer: Upstream, z: int, x: int, y: int) -> Response:
    one = await layer.tile(z, x, y)
    if one is None:
        return Response(status_code=204, headers={"Cache-Control": "no-store"})  # it may be there the next time
    keep = f"private, max-age={min(int(one.fresh_s), _DAY_S)}" if one.fresh_s >= 1 else "no-cache"
    return Response(one.data, media_type=one.kind, headers={"Cache-Control": keep})
