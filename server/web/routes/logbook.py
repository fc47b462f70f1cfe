"""The logbook over HTTP: all drives of a car, as JSON and as a table."""

from __future__ import annotations

import csv
import io
import time
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi import Path as InPath

from monitor.driving_summary import per_km
from server.bus.event_table import safe_cell
from server.protocol.logbook import Course, LogbookAnswer, LogbookDrive
from server.recording.catalog.catalog_db import Which
from server.recording.drive.logbook import logbook
from server.recording.export.formats.csv_zip import when
from server.web.interface import OF_KEPT, files, raises
from server.web.routes.recordings import catalog

router = APIRouter(tags=["recordings"], responses=raises(*OF_KEPT))
Text = Annotated[str | None, Query(max_length=200)]
From = Annotated[
    int | None, Query(alias="from", ge=-(2**53), le=2**53, description="Began then or later, ms since 1970")
]
To = Annotated[int | None, Query(alias="to", ge=-(2**53), le=2**53, description="Began before, ms since 1970")]
_HEADS = (
    *("recording", "vehicle", "started", "title", "tags", "people", "parts"),
    *("distance [m]", "recorded [s]", "interventions", "not described", "alarms", "marks", "blind [s]"),
    *("interventions per autonomous km", "alarms per km"),
    *("autonomous [m]", "manual [m]", "mode not known [m]", "autonomous [s]", "manual [s]", "mode not known [s]"),
    *("departure check", "check signed", "signed by", "items failed", "failed items", "alarms by component"),
)


@router.get("/api/logbook", summary="All drives of a car: weeks, totals, faults by component")
def read(
    request: Request, vehicle: Text = None, tag: Text = None, person: Text = None, since: From = None, until: To = None
) -> LogbookAnswer:
    """From figures that are computed once, when a recording is read: quick with a thousand drives."""
    unread = catalog(request).waiting  # first: what is read meanwhile is then in both
    every = _drives(request, vehicle, None, None, None)
    drives = every if (tag, since, until) == (None, None, None) else _drives(request, vehicle, tag, since, until)
    return logbook(drives, person=person, now_ms=round(time.time() * 1000), every=every, unread=unread)


@router.get(
    "/api/logbook.csv", responses=files("text/csv"), summary="The same drives as a table", response_class=Response
)
def table(
    request: Request, vehicle: Text = None, tag: Text = None, person: Text = None, since: From = None, until: To = None
) -> Response:
    """RFC 4180, a row for each drive; an empty cell is not known."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(_HEADS)
    for drive in _drives(request, vehicle, tag, since, until):
        if person is None or person in drive["people"]:
            writer.writerow([safe_cell(cell) for cell in _row(drive)])
    headers = {"Content-Disposition": 'attachment; filename="logbook.csv"'}
    return Response(out.getvalue(), media_type="text/csv; charset=utf-8", headers=headers)


@router.get(
    "/api/recordings/{id}/course",
    response_model=Course,
    summary="Its course by distance and by time, to compare two drives",
)
def course(request: Request, id: Annotated[str, InPath(max_length=100)]) -> Response:
    """A `Course` as docs/protocol.md has it; 404 where it has not been read yet."""
    body = catalog(request).course(id)
    if body is None:
        raise HTTPException(404, "There is no such recording, or it has not been read yet.")
    return Response(body, media_type="application/json")


def _drives(
    request: Request, vehicle: str | None, tag: str | None, since: int | None, until: int | None
) -> list[LogbookDrive]:
    return catalog(request).drives(Which(vehicle=vehicle, tag=tag, since_ms=since, until_ms=until))


def _row(drive: LogbookDrive) -> list[object]:
    modes = ("autonomous", "manual", "unknown")
    signed_ms = drive["departure_ms"]
    rates = per_km(drive["modes_m"].get("autonomous"), drive["distance_m"], drive["interventions"], drive["alarms"])
    components = "; ".join(f"{name}: {number}" for name, number in drive["components"].items())
    return [
        *(drive["id"], drive["vehicle"], when(drive["started_ms"] / 1000), drive["title"]),
        *("; ".join(drive["tags"]), "; ".join(drive["people"]), drive["parts"]),
        *(drive["distance_m"], drive["driven_s"], drive["interventions"], drive["undescribed"]),
        *(drive["alarms"], drive["marks"]),
        drive["blind_s"],
        *(None if rate is None else round(rate, 3) for rate in (rates["interventions"], rates["alarms"])),
        *(drive["modes_m"].get(mode) for mode in modes),
        *(drive["modes_s"][mode] for mode in modes),
        *(drive["departure"], None if signed_ms is None else when(signed_ms / 1000), drive["departure_by"]),
        drive["departure_failed"] if drive["departure"] == "signed" else None,
        *("; ".join(drive["failed_items"]), components),
    ]
