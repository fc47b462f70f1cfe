"""The map's layers: map files, tiles that are fetched, the picture of the site."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from monitor.geo import offset_m
from server.storage import bounded_toml
from server.web.maps.image_type import media_type, pixels, plain_text
from server.web.maps.mbtiles import MapFile, MapRefused
from server.web.maps.tile_proxy import Upstream

LARGEST_BYTES = 32 * 2**20
MOST_PIXELS = 64 * 10**6  # 256 MB in a browser
LEAST_M, MOST_M = 1.0, 20_000.0  # an edge of the picture on the ground

Place = tuple[Annotated[float, Field(ge=-85.0, le=85.0)], Annotated[float, Field(ge=-180.0, le=180.0)]]


class _Corners(BaseModel):
    model_config = ConfigDict(extra="forbid")
    top_left: Place
    top_right: Place
    bottom_left: Place


class _Beside(BaseModel):
    model_config = ConfigDict(extra="forbid")
    attribution: str = ""
    corners: _Corners


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteImage:
    """The image and the latitude and longitude of its top left, top right and bottom left corner."""

    name: str
    data: bytes
    media_type: str
    corners: tuple[Place, Place, Place]
    attribution: str


def site_image(path: Path) -> SiteImage:
    """The picture with its corners. Raises MapRefused.

    `site.png` needs `site.png.toml` beside it:

        attribution = "Survey of 2026"        # optional, plain text
        [corners]                             # latitude and longitude (WGS84) of the picture's corners
        top_left = [32.2335, -110.9545]
        top_right = [32.2335, -110.9505]
        bottom_left = [32.2305, -110.9545]    # the fourth follows: a picture may be turned, not bent
    """
    beside = path.with_name(path.name + ".toml")
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise MapRefused(f"The site image {path} is larger than {LARGEST_BYTES // 2**20} MB.")
        data = path.read_bytes()
    except OSError as why:
        raise MapRefused(f"The site image {path} cannot be read: {why.strerror or why}.") from None
    kind = media_type(data)
    if kind is None:
        raise MapRefused(f"The site image {path} is neither png, nor jpg, nor webp.")
    width, height = pixels(data) or (0, 0)
    if width * height > MOST_PIXELS:
        raise MapRefused(
            f"The site image {path} has {width} × {height} pixels; a phone can draw {MOST_PIXELS // 10**6} million."
        )
    try:
        sidecar = _Beside.model_validate(bounded_toml.loads(_beginning(beside)))
    except OSError as why:
        raise MapRefused(f"The corners of the site image must be in {beside}: {why.strerror or why}.") from None
    except ValidationError as why:
        first = why.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "it"
        raise MapRefused(
            f"The corners of the site image in {beside} are not usable: {where}: {first['msg']}."
        ) from None
    except ValueError as why:  # no TOML, or no UTF-8
        raise MapRefused(
            f"The corners of the site image in {beside} are not usable: {str(why).removesuffix('.')}."
        ) from None
    corners = (sidecar.corners.top_left, sidecar.corners.top_right, sidecar.corners.bottom_left)
    _check(corners, beside)
    return SiteImage(
        name=hashlib.sha256(data).hexdigest()[:12],
        data=data,
        media_type=kind,
        corners=corners,
        attribution=plain_text(sidecar.attribution),
    )


def _beginning(file: Path) -> bytes:
    with file.open("rb") as opened:
        return opened.read(bounded_toml.MAX_BYTES + 1)


def _check(corners: tuple[Place, Place, Place], beside: Path) -> None:
    top_left, top_right, bottom_left = corners
    across, down = offset_m(*top_left, *top_right), offset_m(*top_left, *bottom_left)
    for edge_m in ((across[0] ** 2 + across[1] ** 2) ** 0.5, (down[0] ** 2 + down[1] ** 2) ** 0.5):
        if not LEAST_M <= edge_m <= MOST_M:
            raise MapRefused(
                f"The corners of the site image in {beside} are {edge_m:.0f} m apart; "
                f"{LEAST_M:.0f} m to {MOST_M / 1000:.0f} km can be drawn."
            )
    area = abs(across[0] * down[1] - across[1] * down[0])
    if area < 0.05 * (across[0] ** 2 + across[1] ** 2) ** 0.5 * (down[0] ** 2 + down[1] ** 2) ** 0.5:
        raise MapRefused(f"The corners of the site image in {beside} are on one line.")


class MapLayers:
    """The map layers from bottom to top: fetched tiles, map files, site image."""

    def __init__(
        self, maps: Iterable[Path] = (), image: Path | None = None, upstream: Callable[[], Upstream] | None = None
    ) -> None:
        """Raises MapRefused."""
        self.maps: dict[str, MapFile] = {}
        self.upstream: Upstream | None = None
        try:
            for path in maps:
                one = MapFile(path)
                if one.layer.name in self.maps:
                    one.close()
                else:
                    self.maps[one.layer.name] = one
            self.image: SiteImage | None = site_image(image) if image is not None else None
            self.upstream = upstream() if upstream is not None else None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        for one in self.maps.values():
            one.close()
        if self.upstream is not None:
            self.upstream.close()
