"""`--broker`, `--key` and `--broker-ca` on the command line of agents and web nodes."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from server.bus.broker import Broker
from server.vehicle.vehicle import Vehicle


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def read(args: argparse.Namespace) -> Broker:
    """Raises ValueError with one sentence."""
    if find_spec("nats") is None or find_spec("nkeys") is None:
        raise ValueError("The client of the broker is not installed: pip install 'catgraph[fleet]'.")
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


def named(vehicles: tuple[Vehicle, ...]) -> tuple[Vehicle, ...]:
    """As they are, where each has a name of ASCII that the broker can carry. Raises ValueError with one sentence."""
    for vehicle in vehicles:
        if not vehicle.name.isascii():
            raise ValueError(f"At a broker the name of a vehicle is of ASCII letters: “{vehicle.name}” is not.")
    return vehicles
