"""What the server answers over HTTP to other programs, beside what the page reads too (answers.py)."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from server.protocol.alarm_state import LogEvent, StandingAlarm
from server.protocol.answers import ExportJob, ExportState, Recording, Total
from server.protocol.doc import doc


class HealthRecordings(Total):
    unread: int


class Health(TypedDict):
    """`GET /api/health`. A caller who is not known gets status and version only."""

    status: Literal["ok", "cars lost", "impaired"]
    version: str
    problems: NotRequired[Annotated[list[str], doc("a sentence each")]]
    lost: NotRequired[Annotated[dict[str, str], doc("cars that send nothing → a sentence")]]
    off: NotRequired[Annotated[list[str], doc("cars that are off on purpose")]]
    boot: NotRequired[Annotated[str, doc("another one after each start of the server")]]
    up_for_s: NotRequired[float]
    vehicles: NotRequired[Annotated[dict[str, str], doc("name → phase")]]
    pages: NotRequired[int]
    recordings: NotRequired[Annotated[HealthRecordings | None, doc("null: none are stored, or the disk hangs")]]


class VehicleRow(TypedDict):
    name: str
    address: str | None
    phase: str


class FoundVehicle(TypedDict):
    name: str
    address: str | None


class VehicleList(TypedDict):
    """`GET /api/vehicles`."""

    vehicles: list[VehicleRow]
    found: Annotated[list[FoundVehicle], doc("announced nearby")]


class TrackLines(TypedDict):
    type: Literal["MultiLineString"]
    coordinates: Annotated[list[list[list[float]]], doc("longitude, latitude [°]; WGS84")]


class TrackProperties(TypedDict):
    length_m: float | None


class Track(TypedDict):
    """`GET /api/track`, as GeoJSON (RFC 7946)."""

    type: Literal["Feature"]
    geometry: TrackLines
    properties: TrackProperties


class EventList(TypedDict):
    """`GET /api/events`, oldest first."""

    events: list[LogEvent]
    last: Annotated[int, doc("the newest number there is")]


class LogPage(EventList):
    """`GET /api/log`, newest first."""

    next_before: Annotated[int | None, doc("the `before` of the following page; null: there is none")]


class AlarmList(TypedDict):
    """`GET /api/alarms`."""

    alarms: list[StandingAlarm]


class ExportList(TypedDict):
    """`GET /api/exports`."""

    exports: list[ExportJob]


class CancelledExport(TypedDict):
    ok: bool
    state: ExportState


class Deleted(Total):
    """What was deleted for good, or is listed after a scan."""

    ok: bool


class TrashList(TypedDict):
    """`GET /api/trash`."""

    recordings: list[Recording]
    next: Annotated[str | None, doc("the `cursor` of the page after this one")]
    all: Total


class MapLayer(TypedDict):
    """Tiles below the map."""

    title: str
    tiles: Annotated[str, doc("address with {z}, {x} and {y}")]
    min_zoom: int
    max_zoom: int
    bounds: list[float] | None
    attribution: str


class FetchedMapLayer(MapLayer):
    upstream: NotRequired[Annotated[dict[str, object], doc("of fetched tiles: the server they come from")]]


class MapImage(TypedDict):
    source: str
    corners: list[list[float]]
    attribution: str


class MapAnswer(TypedDict):
    """`GET /api/map`."""

    layers: list[FetchedMapLayer]
    image: MapImage | None
