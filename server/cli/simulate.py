"""`catgraph simulate`: run a simulated car behind its own rosbridge server, with faults on demand."""

from __future__ import annotations

import argparse
import asyncio
import sys

from server.rosbridge_server.server import CannotListen
from server.simulator.console import HELP, Console, need_stdin, say
from server.simulator.scenarios import SCENARIOS
from server.simulator.service import CarService, serve_car

__all__ = ["CarService", "add_arguments", "run", "serve_car"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "scenarios:\n" + "\n".join(
        f"  {scenario.name:<18} {scenario.sentence}" for scenario in SCENARIOS.values()
    )
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1: this machine only)"
    )
    parser.add_argument("--port", type=int, default=9090, help="port to listen on, 0 for a free one (default 9090)")
    parser.add_argument(
        "--scenario",
        action="append",
        default=[],
        metavar="NAME[@T[+D]]",
        help="start a scenario at T seconds for D seconds; can be repeated",
    )
    parser.add_argument("--ros", type=int, choices=(1, 2), default=1, help="ROS version to imitate (default 1)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default 0)")
    parser.add_argument(
        "--scan-beams",
        type=int,
        metavar="N",
        help="N beams of a full circle at 20 Hz instead of the interlaced 181 and 180",
    )
    parser.add_argument(
        "--no-obstacle-stopper",
        action="store_true",
        help="no obstacle stopper: without commands the car keeps its last speed",
    )
    parser.add_argument(
        "--competing-controller",
        action="store_true",
        help="the lap controller keeps publishing beside other commands: the last message wins",
    )
    parser.add_argument("--rate", type=float, default=1.0, metavar="X", help="speed relative to real time (default 1)")


def run(args: argparse.Namespace) -> int:
    """Serves until it is ended; 2 when it cannot start, 130 when interrupted."""
    need_stdin()
    try:
        with _runner() as runner:
            runner.run(_simulate(args))
    except (CannotListen, ValueError) as why:
        print(f"catgraph: {_sentence(str(why))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


async def _simulate(args: argparse.Namespace) -> None:
    if args.seed < 0:
        raise ValueError("The seed must be 0 or more.")
    service = CarService(
        host=args.host,
        port=args.port,
        seed=args.seed,
        ros_version=args.ros,
        scan_beams=args.scan_beams,
        rate=args.rate,
        scenarios=args.scenario,
        has_stopper=not args.no_obstacle_stopper,
        gives_way=not args.competing_controller,
    )
    port = await service.start()
    host = f"[{args.host}]" if ":" in args.host else args.host
    say(f"Simulated car on ws://{host}:{port} (ROS {args.ros}, seed {args.seed}). Press Ctrl-C to stop.\n{HELP}")
    console = Console.of_stdin(service)
    console.open()
    try:
        await service.wait()
    finally:
        console.close()
        await service.stop()


def _runner() -> asyncio.Runner:
    if sys.platform == "win32":
        return asyncio.Runner()
    import uvloop

    return asyncio.Runner(loop_factory=uvloop.new_event_loop)


def _sentence(text: str) -> str:
    text = text[0].upper() + text[1:]
    return text if text.endswith(".") else f"{text}."
