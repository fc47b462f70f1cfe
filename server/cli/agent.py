"""`catgraph agent`: monitor the cars of this machine, and offer them to web nodes through a broker."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from server.cli import serve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    serve.add_broker_arguments(parser)
    parser.add_argument(
        "--require-signed",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="take orders through web nodes only where the device that gives them has signed them (default: yes)",
    )
    parser.add_argument(
        "--known-devices",
        type=Path,
        metavar="FILE",
        help="take signed orders of the devices in this list only: a key and a name a line",
    )
    serve.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended, with or without the broker; 2 when it cannot start."""
    return serve.run_with(
        lambda: replace(
            serve.common_config(args),
            vehicles=serve.ascii_names(serve.vehicles_of(args)),
            allowed_hosts=tuple(args.only),
            broker=serve.read_broker(args),
            requires_signed=args.require_signed,
            known_devices=args.known_devices,
        )
    )
