"""The optional tile server, from command line and environment, validated. Off by default."""

from __future__ import annotations

import argparse
import os
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

ENVIRONMENT = "CATGRAPH_MAP_UPSTREAM"  # the address may hold a key, which a list of processes would show
DEEPEST = 22
LEAST_MB, MOST_MB = 10, 20_000
_LONGEST = 500
_PLACES = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapUpstream:
    """A server of map tiles, and how much of it may be kept."""

    template: str  # with {z}, {x} and {y}, or {-y} where rows are counted from the south; may hold a key: never shown
    attribution: str  # whose map it is; shown on the map and written into the file
    zoom: tuple[int, int] = (0, 19)
    limit_mb: int = 500

    @property
    def host(self) -> str:
        """The only host that is contacted, with its port if given."""
        return urlsplit(self.template).netloc


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--map-upstream",
        metavar="URL",
        help="a server of map tiles, as https://tiles.example/{z}/{x}/{y}.png; off by default. Only tiles that a page "
        f"shows are fetched, and kept in the data folder as MBTiles. With a key in it, rather set {ENVIRONMENT}",
    )
    parser.add_argument(
        "--map-attribution",
        metavar="TEXT",
        help="the map's attribution, shown on the map; required with --map-upstream",
    )
    parser.add_argument(
        "--map-upstream-zoom", metavar="MIN-MAX", default="0-19", help="zoom levels to fetch (default 0-19)"
    )
    parser.add_argument(
        "--map-upstream-mb",
        type=int,
        metavar="N",
        default=500,
        help="size limit in MB; beyond it the least recently viewed tiles are deleted (default 500)",
    )


def read(args: argparse.Namespace) -> MapUpstream | None:
    """The tile server of the arguments; None: nothing is fetched. Raises ValueError with one sentence."""
    template = args.map_upstream or os.environ.get(ENVIRONMENT)
    if not template:
        return None
    return checked(template, args.map_attribution or "", args.map_upstream_zoom, args.map_upstream_mb)


def checked(template: str, attribution: str, zoom: str, limit_mb: int) -> MapUpstream:
    """Raises ValueError with one sentence, without the address, which may hold a key."""
    _check_template(template)
    if not attribution.strip():
        raise ValueError("--map-upstream needs --map-attribution, which is shown on the map.")
    found = re.fullmatch(r"([0-9]{1,2})-([0-9]{1,2})", zoom)
    if found is None or not int(found[1]) <= int(found[2]) <= DEEPEST:
        raise ValueError(f"--map-upstream-zoom is two levels from 0 to {DEEPEST}, as 0-19.")
    if not LEAST_MB <= limit_mb <= MOST_MB:
        raise ValueError(f"--map-upstream-mb is a number from {LEAST_MB} to {MOST_MB}.")
    return MapUpstream(
        template=template, attribution=attribution, zoom=(int(found[1]), int(found[2])), limit_mb=limit_mb
    )


def _check_template(template: str) -> None:
    subject = "The address of --map-upstream"
    if len(template) > _LONGEST or not template.isascii() or not template.isprintable() or " " in template:
        raise ValueError(f"{subject} is too long or has characters that are not allowed.")
    try:
        parts = urlsplit(template)
        port_is_usable = parts.port is None or 0 < parts.port < 65536
    except ValueError:
        raise ValueError(f"{subject} is not valid.") from None
    if parts.scheme not in ("http", "https") or not parts.hostname or not port_is_usable:
        raise ValueError(f"{subject} must begin with https:// or http:// and a host.")
    if "@" in parts.netloc:
        raise ValueError(f"{subject} must not hold a name and password.")
    if _PLACES.search(parts.netloc) or "{s}" in template:
        raise ValueError(f"{subject} must name one host: without {{s}}.")
    if parts.fragment:
        raise ValueError(f"{subject} must not hold a #.")
    places = sorted(_PLACES.findall(template))
    if places not in (["x", "y", "z"], ["-y", "x", "z"]):
        raise ValueError(
            f"{subject} must hold {{z}}, {{x}} and {{y}} (or {{-y}}) once each, and nothing else in braces."
        )
