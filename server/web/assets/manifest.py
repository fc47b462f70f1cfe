"""What a phone must know to install the page: its names, where it begins, its icons, and the tabs as shortcuts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from server.web.assets.icons import FOLDER, ICONS

SHORTCUTS = (("Map", "map"), ("Scan", "scan"), ("Files", "files"), ("Settings", "settings"))  # of the page's tabs
_INK = "#0a0c0d"  # the dark panel of VISUAL.md, behind the icon while the page begins
_ANY = "icons/catgraph.svg"


def manifest(asset: Callable[[str], str], *, are_drawn: bool) -> dict[str, Any]:
    """https://www.w3.org/TR/appmanifest/ · `asset`: the address of a static file; `are_drawn`: the PNGs are there."""
    icons = [{"src": asset(_ANY), "sizes": "any", "type": "image/svg+xml", "purpose": "any"}]
    if are_drawn:
        icons += [
            {
                "src": asset(f"{FOLDER}/{icon.name}"),
                "sizes": f"{icon.side}x{icon.side}",
                "type": "image/png",
                "purpose": icon.purpose,
            }
            for icon in ICONS
            if icon.purpose
        ]
    else:
        for kind in ("maskable", "monochrome"):
            source = asset(f"icons/catgraph-{kind}.svg")
            icons.append({"src": source, "sizes": "any", "type": "image/svg+xml", "purpose": kind})
    return {
        "id": "/",
        "name": "catgraph",
        "short_name": "catgraph",
        "description": "Monitors an autonomous test car. Not an emergency stop.",
        "lang": "en",
        "dir": "ltr",
        "start_url": "/",
        "scope": "/",
        "display": "standalone",
        "orientation": "any",
        "categories": ["utilities", "productivity"],
        "background_color": _INK,
        "theme_color": _INK,
        "prefer_related_applications": False,
        "icons": icons,
        "shortcuts": [{"name": name, "url": f"/#{tab}", "icons": _small(asset, are_drawn)} for name, tab in SHORTCUTS],
    }


def _small(asset: Callable[[str], str], are_drawn: bool) -> list[dict[str, str]]:
    if are_drawn:
        return [{"src": asset(f"{FOLDER}/icon-192.png"), "sizes": "192x192", "type": "image/png"}]
    return [{"src": asset(_ANY), "sizes": "any", "type": "image/svg+xml"}]
