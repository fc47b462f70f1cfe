"""`catgraph agent`: monitor the cars of this machine, and offer them to web nodes through a broker."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from server.cli import broker_options
from server.cli import serve as serve_command


def add_arguments(parser: argparse.ArgumentParser) -> None:
    broker_options.add_arguments(parser)
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
    serve_command.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended, with or without the broker; 2 when it cannot start."""
    return serve_command.run_with(
        lambda: replace(
            serve_command.common_config(args),
            vehicles=broker_options.named(serve_command.vehicles_of(args)),
            allowed_hosts=tuple(args.only),
            broker=broker_options.read(args),
            requires_signed=args.require_signed,
            known_devices=args.known_devices,
        )
    )
