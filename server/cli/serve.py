"""`catgraph serve`: monitor cars and serve the page."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import replace

from server.access.credentials import keys_from
from server.app import store, tls_process
from server.app.config import Config
from server.app.process import CannotServe, add_common_arguments, serve
from server.app.process import run as run_server
from server.cli import logging
from server.vehicle.vehicle import Vehicle, vehicle_from_text
from server.web.maps import map_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vehicle",
        action="append",
        default=[],
        metavar="[NAME=]ws://CAR:9090",
        help="a car to connect to at the start, foxglove://CAR:8765 for a Foxglove server; can be repeated; "
        "without it the page prompts for an address",
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="HOST",
        help="connect to this host only; can be repeated",
    )
    add_common_arguments(parser)
    logging.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended; 2 when it cannot start."""
    return run_with(lambda: replace(common_config(args), vehicles=vehicles_of(args), allowed_hosts=tuple(args.only)))


def vehicles_of(args: argparse.Namespace) -> tuple[Vehicle, ...]:
    """Raises ValueError with one sentence."""
    vehicles = tuple(vehicle_from_text(text, index=i) for i, text in enumerate(args.vehicle))
    if len({vehicle.name for vehicle in vehicles}) < len(vehicles):
        raise ValueError("Two vehicles have the same name.")
    return vehicles or (Vehicle(name="car"),)


def common_config(args: argparse.Namespace) -> Config:
    """What the options of `add_common_arguments` say. Raises ValueError with one sentence."""
    return Config(
        data=args.data,
        host=args.host,
        port=args.port,
        maps=tuple(args.map),
        site_image=args.site_image,
        tls=tls_process.read_options(args),
        names=tuple(args.name),
        keys=keys_from(os.environ),
        map_upstream=map_options.read(args),
        worker=not args.no_worker,
        store=store.read_options(args, os.environ),
    )


def run_with(make: Callable[[], Config]) -> int:
    """Serves what `make` gives until it is ended; 2 when it cannot start."""
    try:
        return run_server(serve(make()))
    except (CannotServe, ValueError) as why:
        print(f"catgraph: {why}", file=sys.stderr)
        return 2
