"""The tabs of the page, in their order; what fills each of them is named in static/js/shell/tab-contents.js."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Tab:
    """One tab. Where `templates/_NAME.html` exists, it is the first content of its panel."""

    name: str  # in the address of the page, "#map", and of its panel
    label: str  # in at most 8 letters: six tabs are side by side on the narrowest phone
    what: str  # its subject in a sentence: "The map could not be fetched"
    icon: str  # path of an SVG of 24 by 24, stroked
    wide: Literal["pane", "drawer", "page"] = (
        "page"  # on a wide screen: part of Watch, over its middle, or in its place
    )


TABS = (
    Tab(name="home", label="Home", what="Home", wide="pane", icon="M3 17a9 9 0 1 1 18 0 M12 17l4.5-6.5 M3 20.5h18"),
    Tab(
        name="map", label="Map", what="The map", wide="pane", icon="M3 6l6-2 6 2 6-2v14l-6 2-6-2-6 2z M9 4v14 M15 6v14"
    ),
    Tab(
        name="scan",
        label="Scan",
        what="The scan",
        wide="pane",
        icon="M12 20 4 8.5a14 14 0 0 1 16 0z M8 14.2a7 7 0 0 1 8 0",
    ),
    Tab(name="files", label="Files", what="The recordings", icon="M3 6v13.5h18V8.5h-9L9.5 6z"),
    Tab(
        name="settings",
        label="Settings",
        what="The settings",
        wide="drawer",
        icon="M3 7h8 M17 7h4 M11 7a3 3 0 1 0 6 0 3 3 0 1 0-6 0 M3 17h3 M12 17h9 M6 17a3 3 0 1 0 6 0 3 3 0 1 0-6 0",
    ),
)
