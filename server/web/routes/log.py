"""The alarm log: paged and filtered for pages, whole as CSV or JSON for people."""

from __future__ import annotations

import csv
import io
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import Response, StreamingResponse

from monitor.alarm_spec import Priority, priority_of
from server.bus.bus import PageBus
from server.bus.event_table import COLUMNS, event_row
from server.protocol.alarm_state import LogEvent
from server.protocol.http_answers import LogPage
from server.web.interface import files, raises
from server.web.routes.session_request import VehicleName, vehicle_of
from server.web.services import Services, services

router = APIRouter(tags=["alarms"], responses=raises(404, 503))
_PAGE = 500
_LOOKED_THROUGH = 2000  # events scanned per page of results: a rare search text must not block the loop

Text = Annotated[str | None, Query(max_length=120)]
Urgency = Annotated[Priority | None, Query(description="Only of alarms of this priority")]
SearchText = Annotated[str | None, Query(max_length=120, description="In title, text, by whom or name of the alarm")]
Milliseconds = Annotated[int | None, Query(ge=0, le=2**53)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Which:
    """Which events are wanted; None: all."""

    alarm: str | None = None  # "": those of no alarm
    change: str | None = None
    priority: str | None = None
    text: str | None = None
    since_ms: int | None = None
    until_ms: int | None = None

    def has(self, event: Mapping[str, Any]) -> bool:
        return (
            (self.alarm is None or (event.get("alarm") or "") == self.alarm)
            and (self.change is None or event["change"] == self.change)
            and (self.priority is None or _priority(event) == self.priority)
            and (self.text is None or self.text.casefold() in _words_of(event))
            and (self.since_ms is None or event["at_ms"] >= self.since_ms)
            and (self.until_ms is None or event["at_ms"] < self.until_ms)
        )


def wanted(
    alarm: Text = None,
    change: Text = None,
    priority: Urgency = None,
    text: SearchText = None,
    since_ms: Milliseconds = None,
    until_ms: Milliseconds = None,
) -> Which:
    """The filters of a request, the same for pages and exports."""
    return Which(alarm=alarm, change=change, priority=priority, text=text or None, since_ms=since_ms, until_ms=until_ms)


Wanted = Annotated[Which, Depends(wanted)]


def _priority(event: Mapping[str, Any]) -> Priority | None:
    """None: of no alarm."""
    return priority_of(event.get("priority")) if event.get("alarm") else None


def _words_of(event: Mapping[str, Any]) -> str:
    return " ".join(str(event.get(name) or "") for name in ("title", "text", "by", "alarm", "change")).casefold()


@router.get("/api/log", response_model=LogPage, summary="The alarm log, newest first, a page at a time")
async def log_page(
    request: Request,
    which: Wanted,
    vehicle: VehicleName = None,
    before: Annotated[int | None, Query(ge=1, le=2**53, description="Only numbers below this")] = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> Response:
    """`next_before` requests the following page; null: there is none. A page can be short or empty with more to come:
    after 2000 events without a match the search continues in the next request."""
    app = services(request)
    name = vehicle_of(app, vehicle)
    events, more = await _page(app.bus, name, which, before, limit)
    body = {"events": events, "next_before": more, "last": app.bus.last_event(name)}
    return Response(orjson.dumps(body), media_type="application/json")


@router.get(
    "/api/log.csv", response_class=Response, responses=files("text/csv"), summary="The alarm log as CSV, oldest first"
)
async def log_csv(request: Request, which: Wanted, vehicle: VehicleName = None) -> StreamingResponse:
    app = services(request)
    name = await _answering(app, vehicle)
    return StreamingResponse(
        _csv(_all(app.bus, name, which), _named(app, name)),
        media_type="text/csv; charset=utf-8",
        headers=_attachment(f"catgraph-log-{name}.csv"),
    )


@router.get("/api/log.json", response_model=list[LogEvent], summary="The alarm log as JSON, oldest first")
async def log_json(request: Request, which: Wanted, vehicle: VehicleName = None) -> StreamingResponse:
    app = services(request)
    name = await _answering(app, vehicle)
    return StreamingResponse(
        _json(_all(app.bus, name, which), _named(app, name)),
        media_type="application/json",
        headers=_attachment(f"catgraph-log-{name}.json"),
    )


async def _answering(app: Services, vehicle: str | None) -> str:
    """The vehicle whose log is meant. Raises NotServed where it cannot be read, before the answer begins."""
    name = vehicle_of(app, vehicle)
    await app.bus.events_after(name, 0, 1)
    return name


async def _page(
    bus: PageBus, vehicle: str, which: Which, before: int | None, limit: int
) -> tuple[list[dict[str, Any]], int | None]:
    """Newest first, and where the next page begins."""
    found: list[dict[str, Any]] = []
    for _ in range(_LOOKED_THROUGH // _PAGE):
        portion = await bus.find_events(
            vehicle,
            before=before,
            limit=_PAGE,
            alarm=which.alarm,
            change=which.change,
            since_ms=which.since_ms,
            until_ms=which.until_ms,
        )
        for event in portion:
            if len(found) == limit:
                return found, before
            before = event["n"]
            if which.has(event):
                found.append(event)
        if len(portion) < _PAGE:
            return found, None
    return found, before if before and before > 1 else None


def _attachment(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}


async def _all(bus: PageBus, vehicle: str, which: Which) -> AsyncIterator[list[dict[str, Any]]]:
    """All events of a vehicle that fit, oldest first, in portions."""
    n = 0
    while events := await bus.events_after(vehicle, n, _PAGE):
        n = events[-1]["n"]
        yield [event for event in events if which.has(event)]


def _named(app: Services, vehicle: str) -> dict[str, str]:
    """The car's name for each exported event, where the server has several cars: files can then be joined."""
    return {"vehicle": vehicle} if len(app.vehicles) > 1 else {}


async def _csv(portions: AsyncIterator[list[dict[str, Any]]], named: dict[str, str]) -> AsyncIterator[str]:
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow([*named, *COLUMNS])
    async for events in portions:
        for event in events:
            rows.writerow([*named.values(), *event_row(event)])
        yield text.getvalue()
        text.seek(0)
        text.truncate()
    yield text.getvalue()  # the columns, where there is no event


async def _json(portions: AsyncIterator[list[dict[str, Any]]], named: dict[str, str]) -> AsyncIterator[bytes]:
    yield b"["
    first = True
    async for events in portions:
        for event in events:
            yield (b"" if first else b",\n") + orjson.dumps({**named, **event})
            first = False
    yield b"]"
