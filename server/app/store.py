"""Makes the parts of a server that has a store: the uploader of its recordings, and the list of what is there."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from server.app.config import Store
from server.recording.store.rules import Place, Situation, rule_of
from server.vehicle.session import Session
from server.web.services import Services


def add(running: Services, store: Store | None, data: Path | None) -> None:
    """`store` None: there is none; `data` None: this server has no recordings of its own.

    Raises OSError where nothing can be kept in `data`.
    """
    if store is None:
        return
    # Only here: without a store obstore need not be installed.
    from server.recording.store.object_store import ObjectStore
    from server.recording.store.stored_list import StoredRecordings
    from server.recording.store.uploader import Uploader
    from server.recording.store.uploads import Uploads

    objects = ObjectStore(store.address)
    running.stored = StoredRecordings(objects, now=running.now)
    if data is None or running.recordings is None:
        return
    try:
        uploads = Uploads(data / "store" / "uploads.sqlite")
    except sqlite3.Error as why:
        raise OSError(f"the state of the uploads: {why}") from None
    running.uploader = Uploader(
        objects,
        uploads,
        running.recordings,
        lambda: {name: situation(session, running.now()) for name, session in running.sessions.items()},
        clips=data / "store" / "clips",
        interface=store.depot_interface,
        now=running.now,
        wall_ms=running.wall_ms,
    )


def situation(session: Session, now_s: float) -> Situation:
    """The settings of a car and where it is; what is old or has no fix is not known."""
    readings = session.judgement.state.snapshot(now_s).readings
    position, speed = readings.get("position"), readings.get("speed")
    has_place = position is not None and position.is_fresh(now_s) and position.value.status >= 0
    place = Place(
        lat_deg=position.value.lat_deg if position is not None and has_place else None,
        lon_deg=position.value.lon_deg if position is not None and has_place else None,
        speed_mps=speed.value.speed_mps if speed is not None and speed.is_fresh(now_s) else None,
    )
    return Situation(rule=rule_of(session.limits.store), place=place)
