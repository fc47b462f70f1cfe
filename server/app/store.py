"""The store of a server: `--store` and what belongs to it on the command line, and the parts that use it.

The login is never on the command line. The parts are the uploader of recordings and the list of what is there.
"""

from __future__ import annotations

import argparse
import re
import sqlite3
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from server.app.config import Store
from server.recording.store.address import store_address
from server.recording.store.rules import Place, Situation, rule_of
from server.vehicle.session import Session
from server.web.services import Services


def add_arguments(parser: argparse.ArgumentParser, *, uploads: bool) -> None:
    """`uploads`: this command has recordings of its own."""
    what = "recordings are uploaded into it" if uploads else "recordings of all cars in it are listed"
    parser.add_argument("--store", metavar="s3://BUCKET/FOLDER", help=f"an S3-compatible store: {what}")
    parser.add_argument(
        "--store-endpoint",
        metavar="https://HOST:PORT",
        help="its address, if it is not Amazon's (default: AWS_ENDPOINT_URL)",
    )
    parser.add_argument("--store-region", metavar="REGION", help="its region (default: AWS_REGION, else us-east-1)")
    parser.add_argument(
        "--store-key",
        type=Path,
        metavar="FILE",
        help="its login: access_key_id and secret_access_key as TOML, mode 600 "
        "(default: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY)",
    )
    parser.add_argument(
        "--store-ca",
        type=Path,
        metavar="FILE",
        help="a certificate (PEM) to trust beside those of the system",
    )
    if uploads:
        parser.add_argument(
            "--depot-interface",
            metavar="wlan0",
            help="a network interface that is connected in the depot only (see Settings, Store)",
        )


def read_options(args: argparse.Namespace, environment: Mapping[str, str]) -> Store | None:
    """None: no store is named. Raises ValueError with one sentence."""
    interface: str | None = getattr(args, "depot_interface", None)
    if args.store is None:
        for name in ("store_endpoint", "store_region", "store_key", "store_ca"):
            if getattr(args, name) is not None:
                raise ValueError(f"--{name.replace('_', '-')} has no effect without --store.")
        if interface is not None:
            raise ValueError("--depot-interface has no effect without --store.")
        return None
    if find_spec("obstore") is None:
        raise ValueError("The client of the store is not installed: pip install '.[store]' in catgraph's folder.")
    if interface is not None and not re.fullmatch(r"[A-Za-z0-9_.-]{1,15}", interface):
        raise ValueError(f"“{interface[:40]}” is no name of a network interface.")
    if args.store_ca is not None and not args.store_ca.is_file():
        raise ValueError(f"There is no certificate {args.store_ca}.")
    address = store_address(
        args.store,
        endpoint=args.store_endpoint,
        region=args.store_region,
        key_file=args.store_key,
        authority=args.store_ca,
        environment=environment,
    )
    return Store(address=address, depot_interface=interface)


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
