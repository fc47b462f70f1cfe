"""What lies under the map: the tiles of map files and the picture of the site, all from this server."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fastapi import APIRouter, HTTPException, Request, Response

from server.web.api import running
from server.web.mbtiles import MapFile
from server.web.site_image import SiteImage, site_image

router = APIRouter()
_YEAR = "public, max-age=31536000, immutable"  # a file with other content has another name
_NUMBER = re.compile(r"[0-9]{1,9}")  # more digits are no tile's, and turning them into a number may cost or fail


class Ground:
    """The open map files, in the order in which they lie on each other, and the picture above them."""

    def __init__(self, maps: Iterable[Path] = (), image: Path | None = None) -> None:
        """Raises MapRefused."""
        self.maps: dict[str, MapFile] = {}
        try:
            for path in maps:
                one = MapFile(path)
                if one.layer.name in self.maps:
                    one.close()
                else:
                    self.maps[one.layer.name] = one
            self.image: SiteImage | None = site_image(image) if image is not None else None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        for one in self.maps.values():
            one.close()


@router.get("/api/map", tags=["map"], summary="What lies under the map: layers of tiles, the picture of the site")
async def ground(request: Request) -> dict[str, Any]:
    under = running(request).ground
    image = under.image
    return {
        "layers": [
            {
                "title": layer.title,
                "tiles": f"/map/{layer.name}/{{z}}/{{x}}/{{y}}",
                "min_zoom": layer.zoom[0],
                "max_zoom": layer.zoom[1],
                "bounds": layer.bounds,
                "attribution": layer.attribution,
            }
            for layer in (one.layer for one in under.maps.values())
        ],
        "image": image
        and {"source": f"/map/site/{image.name}", "corners": image.corners, "attribution": image.attribution},
    }


@router.get("/map/site/{name}", tags=["map"], summary="The picture of the site", response_class=Response)
async def picture(request: Request, name: str) -> Response:
    image = running(request).ground.image
    if image is None or name != image.name:
        raise HTTPException(404, "There is no such picture.")
    return Response(image.data, media_type=image.media_type, headers={"Cache-Control": _YEAR})


# No `async`: a file may lie on a slow disk, and the loop must not wait for it.
@router.get(
    "/map/{name}/{z}/{x}/{y}",
    tags=["map"],
    summary="A tile, rows counted from the north; 204 where the map has none",
    response_class=Response,
)
def tile(request: Request, name: str, z: str, x: str, y: str) -> Response:
    found = running(request).ground.maps.get(name)
    if found is None or not all(_NUMBER.fullmatch(number) for number in (z, x, y)):
        raise HTTPException(404, "There is no such tile.")
    picture = found.tile(int(z), int(x), int(y))
    if picture is None:
        return Response(status_code=204, headers={"Cache-Control": "public, max-age=3600"})
    return Response(picture[0], media_type=picture[1], headers={"Cache-Control": _YEAR})
