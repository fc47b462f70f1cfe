"""The alarm log: paged and filtered for pages, whole as CSV or JSON for people."""

from __future__ import annotations

import csv
import io
from collections.abc import AsyncIterator, Iterator
from datetime import UTC, datetime
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Query, Request
from fastapi.responses import Response, StreamingResponse

from server.bus import LocalBus
from server.web.api import VehicleName, running, vehicle_of

router = APIRouter()
COLUMNS = ("n", "time", "change", "alarm", "occurrence", "title", "priority", "text", "by", "settings_version")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet runs a cell that begins so
_PAGE = 500

Text = Annotated[str | None, Query(max_length=120)]
Milliseconds = Annotated[int | None, Query(ge=0, le=2**53)]


@router.get("/api/log", tags=["alarms"], summary="The alarm log, newest first, a page at a time")
async def log_page(
    request: Request,
    vehicle: VehicleName = None,
    before: Annotated[int | None, Query(ge=1, le=2**53, description="Only numbers below this")] = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
    alarm: Text = None,
    change: Text = None,
    since_ms: Milliseconds = None,
    until_ms: Milliseconds = None,
) -> Response:
    app = running(request)
    name = vehicle_of(app, vehicle)
    events = app.bus.find_events(
        name, before=before, limit=limit, alarm=alarm, change=change, since_ms=since_ms, until_ms=until_ms
    )
    more = events[-1]["n"] if len(events) == limit and events[-1]["n"] > 1 else None
    body = {"events": events, "next_before": more, "last": app.bus.last_event(name)}
    return Response(orjson.dumps(body), media_type="application/json")


@router.get("/api/log.csv", tags=["alarms"], summary="The whole alarm log as CSV, oldest first")
async def log_csv(request: Request, vehicle: VehicleName = None) -> StreamingResponse:
    app = running(request)
    name = vehicle_of(app, vehicle)
    return StreamingResponse(
        _csv(app.bus, name), media_type="text/csv; charset=utf-8", headers=_attachment(f"catgraph-log-{name}.csv")
    )


@router.get("/api/log.json", tags=["alarms"], summary="The whole alarm log as JSON, oldest first")
async def log_json(request: Request, vehicle: VehicleName = None) -> StreamingResponse:
    app = running(request)
    name = vehicle_of(app, vehicle)
    return StreamingResponse(
        _json(app.bus, name), media_type="application/json", headers=_attachment(f"catgraph-log-{name}.json")
    )


def _attachment(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}


def _all(bus: LocalBus, vehicle: str) -> Iterator[list[dict[str, Any]]]:
    """In portions; the generators that use it are asynchronous, so that they run on the loop, as the log does."""
    n = 0
    while events := bus.events_after(vehicle, n, _PAGE):
        n = events[-1]["n"]
        yield events


async def _csv(bus: LocalBus, vehicle: str) -> AsyncIterator[str]:
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(COLUMNS)
    for events in _all(bus, vehicle):
        for event in events:
            time = datetime.fromtimestamp(event["at_ms"] / 1000, UTC).isoformat(timespec="milliseconds")
            rows.writerow([_cell(time if column == "time" else event.get(column)) for column in COLUMNS])
        yield text.getvalue()
        text.seek(0)
        text.truncate()
    yield text.getvalue()  # the columns, where there is no event


def _cell(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


async def _json(bus: LocalBus, vehicle: str) -> AsyncIterator[bytes]:
    yield b"["
    first = True
    for events in _all(bus, vehicle):
        for event in events:
            yield (b"" if first else b",\n") + orjson.dumps(event)
            first = False
    yield b"]"
