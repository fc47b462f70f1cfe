"""`catgraph web`: serve the page of all cars whose agents are at a broker."""

from __future__ import annotations

import argparse
from dataclasses import replace

from server.app.process import add_common_arguments
from server.cli import logging, serve
from server.vehicle.vehicle import named


def add_arguments(parser: argparse.ArgumentParser) -> None:
    serve.add_broker_arguments(parser)
    parser.add_argument(
        "--expect",
        action="append",
        default=[],
        metavar="NAME",
        help="a car that is listed as lost until its agent connects; can be repeated",
    )
    parser.add_argument(
        "--forget",
        action="append",
        default=[],
        metavar="NAME",
        help="a car whose agent once connected and that does not exist any more; can be repeated",
    )
    add_common_arguments(parser, has_cars=False)
    logging.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended; 2 when it cannot start."""
    return serve.run_with(
        lambda: replace(
            serve.common_config(args),
            vehicles=(),
            broker=serve.read_broker(args),
            is_node=True,
            expected=tuple(one.name for one in serve.ascii_names(tuple(named(name) for name in args.expect))),
            forgotten=tuple(args.forget),
        )
    )
