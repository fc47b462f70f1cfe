"""`catgraph demo`: a simulated car, its bridge and the page in one process, nothing to set up."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

from server.app.config import default_data
from server.app.process import CannotServe, add_common_arguments, serve
from server.app.process import run as run_server
from server.cli.serve import common_config
from server.simulator.console import Console, need_stdin
from server.simulator.service import CarService
from server.system.loopback import is_loopback
from server.vehicle.vehicle import Vehicle


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=1, help="seed of the noise (default 1)")
    parser.add_argument(
        "--scenario",
        action="append",
        default=[],
        metavar="NAME[@T[+D]]",
        help="a fault at T s for D s; see catgraph simulate --help",
    )
    add_common_arguments(parser)
    parser.set_defaults(data=demo_data())


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended; 2 when it cannot start."""
    need_stdin()
    try:
        return run_server(_demo(args))
    except (CannotServe, ValueError) as why:
        print(f"catgraph: {why}", file=sys.stderr)
        return 2


async def _demo(args: argparse.Namespace) -> int:
    service = CarService(seed=args.seed, scenarios=args.scenario)
    port = await service.start()
    address = f"ws://127.0.0.1:{port}"
    config = replace(
        common_config(args),
        vehicles=(Vehicle(name="demo", address=address),),
        found=(Vehicle(name="Simulated car", address=address),),
        next_steps=(records_into(args.data), *next_steps(args.host, sys.argv[0])),
    )
    console = Console.of_stdin(service)
    console.open()
    try:
        return await serve(config)
    finally:
        console.close()
        await service.stop()


def demo_data() -> Path:
    """Apart from the data folder of real cars, whose list of recordings stays free of simulated drives."""
    return default_data().with_name(f"{default_data().name}-demo")


def records_into(data: Path) -> str:
    return f"It records into {data}/recordings; remove {data} when you are done."


def next_steps(host: str, program: str) -> tuple[str, ...]:
    """What to do after the start, a line each; `program`: as it was called."""
    command = f"{os.path.relpath(sys.executable)} -m server" if program.endswith("__main__.py") else program
    phone = (
        f"A phone: press Ctrl-C, start `{command} demo --host 0.0.0.0`, and scan the code that it prints."
        if is_loopback(host)
        else "A phone: pair it as described above."
    )
    return (
        "Next:",
        "  An alarm: open the address, type `speeding 20` here and press Enter. The car drives too fast for 20 s.",
        "  More faults: type `list` here; `stop` ends them.",
        f"  {phone}",
    )
