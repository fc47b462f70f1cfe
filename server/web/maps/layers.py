"""The map's layers: map files, tiles that are fetched, the picture of the site."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from server.web.maps.mbtiles import MapFile
from server.web.maps.site_image import SiteImage, site_image
from server.web.maps.tile_proxy import Upstream


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
