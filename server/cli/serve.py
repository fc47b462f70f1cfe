"""`catgraph serve`: monitor cars and serve the page; and the options that agents and web nodes have as well."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from server.access.credentials import keys_from
from server.app import store, tls_process
from server.app.config import Config
from server.app.process import CannotServe, add_common_arguments, serve
from server.app.process import run as run_server
from server.bus.broker import Broker
from server.cli import logging
from server.rosbridge.address import BadAddress, demand_allowed, parse
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
    for vehicle in vehicles:
        _demand_address(vehicle, args.only)
    return vehicles or (Vehicle(name="car"),)


def _demand_address(vehicle: Vehicle, only: list[str]) -> None:
    """Raises ValueError with one sentence where the address of a vehicle is none that can be dialled."""
    if not vehicle.address:
        return
    try:
        demand_allowed(parse(vehicle.address), only)
    except BadAddress as why:
        hint = "Name its host with --only too." if why.code == "not_allowed" else why.hint
        raise ValueError(f"--vehicle {vehicle.name}: {why} {hint}".rstrip()) from None


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


def add_broker_arguments(parser: argparse.ArgumentParser) -> None:
    """`--broker`, `--key` and `--broker-ca` of agents and web nodes."""
    parser.add_argument(
        "--broker",
        required=True,
        metavar="tls://HOST:4222",
        help="the NATS broker; nats://HOST:4222 without encryption",
    )
    parser.add_argument("--key", type=Path, metavar="FILE", help="the key that `catgraph fleet add` printed")
    parser.add_argument(
        "--broker-ca",
        type=Path,
        metavar="FILE",
        help="the certificate (PEM) that signed the broker's (default: those of the system)",
    )


def read_broker(args: argparse.Namespace) -> Broker:
    """What the options of `add_broker_arguments` state. Raises ValueError with one sentence."""
    if find_spec("nats") is None or find_spec("nkeys") is None:
        raise ValueError("The client of the broker is not installed: pip install '.[fleet]' in catgraph's folder.")
    try:
        address = urlsplit(args.broker)
        is_one = address.scheme in ("nats", "tls") and address.hostname and (address.port or True)
    except ValueError:
        is_one = False
    if not is_one:
        raise ValueError(f"“{args.broker[:80]}” is no address of a broker: use tls://HOST:4222 or nats://HOST:4222.")
    if args.broker_ca is not None and not args.broker.startswith("tls:"):
        raise ValueError("--broker-ca has no effect without tls://.")
    return Broker(address=args.broker, key=args.key, authority=args.broker_ca)


def ascii_names(vehicles: tuple[Vehicle, ...]) -> tuple[Vehicle, ...]:
    """As they are, where each has a name of ASCII that the broker can carry. Raises ValueError with one sentence."""
    for vehicle in vehicles:
        if not vehicle.name.isascii():
            raise ValueError(f"At a broker the name of a vehicle is of ASCII letters: “{vehicle.name}” is not.")
    return vehicles
