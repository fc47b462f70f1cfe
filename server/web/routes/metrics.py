"""Counters for a Prometheus that watches the server, in its text format."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, Request
from fastapi.responses import PlainTextResponse

from server.recording.catalog.catalog import Catalog
from server.recording.catalog.catalog_db import Which
from server.web.services import services

router = APIRouter()
_TEXT = "text/plain; version=0.0.4; charset=utf-8"


@router.get("/metrics", tags=["server"], summary="Counters, as Prometheus reads them", response_class=PlainTextResponse)
async def metrics(request: Request) -> PlainTextResponse:
    app = services(request)
    lines = []

    def add(name: str, kind: str, help: str, rows: list[tuple[str, float]]) -> None:
        lines.append(f"# HELP catgraph_{name} {help}")
        lines.append(f"# TYPE catgraph_{name} {kind}")
        lines.extend(f"catgraph_{name}{labels} {value:g}" for labels, value in rows)

    add("pages", "gauge", "Pages connected.", [("", app.hub.pages)])
    add(
        "frames_skipped_total",
        "counter",
        "Frames replaced by newer ones before a page took them.",
        [("", app.hub.skipped)],
    )
    add("up_seconds", "gauge", "Seconds since the server started.", [("", app.now() - app.started_s)])
    if app.link is not None:
        connected = float(app.link.complaint is None)
        add("broker_connected", "gauge", "1 while the broker is connected.", [("", connected)])
        served = float(sum(app.bus.trouble(name) is None for name in app.vehicles))
        add("vehicles_heard", "gauge", "Vehicles that send something.", [("", served)])
    if app.recordings is not None:
        for name, help, rows in await asyncio.to_thread(_recorded, app.recordings):  # it reads a disk
            add(name, "gauge", help, rows)
    received, rejected, open_, lag, load, chattering, kept, phones = [], [], [], [], [], [], [], []
    for name, session in app.sessions.items():
        vehicle = f'vehicle="{name}"'
        for signal, tally in session.judgement.reception.by_signal.items():
            received.append((f'{{{vehicle},signal="{signal}"}}', float(tally.received)))
            rejected.append((f'{{{vehicle},signal="{signal}"}}', float(tally.rejected)))
        open_.append((f"{{{vehicle}}}", float(session.phase == "monitoring")))
        phones.append((f"{{{vehicle}}}", float(session.judgement.state.phones(app.now()))))
        lag.append((f"{{{vehicle}}}", session.lag_s))
        load.append((f"{{{vehicle}}}", float(session.judgement.load.in_10_min)))
        chattering.append((f"{{{vehicle}}}", float(len(session.judgement.load.chattering))))
        kept.append((f"{{{vehicle}}}", float(session.log_trouble is None)))
    add("messages_received_total", "counter", "Messages of the car, proper or not, since it was connected.", received)
    add(
        "messages_rejected_total",
        "counter",
        "Messages that were not proper ones, since the car was connected.",
        rejected,
    )
    add("link_open", "gauge", "1 while the bridge is connected.", open_)
    add("alarms_announced_10_min", "gauge", "Alarms announced in the last ten minutes; more than 10: a flood.", load)
    add("alarms_chattering", "gauge", "Alarms that came and went three times within the last minute.", chattering)
    add("alarm_log_kept", "gauge", "1 while the alarm log is kept on the disk.", kept)
    add("phones", "gauge", "Phones that share their position, or the reason why not.", phones)
    add("tick_lag_seconds", "gauge", "How late the newest tick was.", lag)
    return PlainTextResponse("\n".join(lines) + "\n", media_type=_TEXT)


def _recorded(catalog: Catalog) -> list[tuple[str, str, list[tuple[str, float]]]]:
    """Name, help and rows of the metrics of recordings."""
    places = [('{place="kept"}', catalog.totals()), ('{place="trash"}', catalog.totals(Which(is_trashed=True)))]
    free = catalog.free_bytes()
    return [
        ("recordings", "Recordings in the folder and in the trash.", [(at, t["count"]) for at, t in places]),
        ("recordings_bytes", "What they take of the disk.", [(at, t["bytes"]) for at, t in places]),
        ("recordings_unread", "Recordings that are yet to be read.", [("", catalog.waiting)]),
        ("recordings_unreadable", "Recordings that cannot be read.", [("", catalog.unreadable)]),
        ("disk_free_bytes", "What the disk of the recordings has left.", [] if free is None else [("", free)]),
    ]
