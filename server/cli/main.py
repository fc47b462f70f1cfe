"""The command line: one sub-command a job, each answering with an exit code and, where it cannot go on, one
sentence."""

from __future__ import annotations

import argparse
import importlib
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from server.cli import logging
from server.version import catgraph_version


@dataclass(frozen=True, slots=True, kw_only=True)
class _Command:
    """A sub-command; its module has `add_arguments(parser)` and `run(args) -> int` and is imported only when it is
    called."""

    module: str
    help: str


COMMANDS = {
    "serve": _Command(module="server.cli.serve", help="monitor cars and serve the page"),
    "agent": _Command(module="server.cli.agent", help="monitor cars, and offer them to web nodes through a broker"),
    "web": _Command(module="server.cli.web", help="serve the page of the cars whose agents are at a broker"),
    "fleet": _Command(module="server.cli.fleet", help="make and withdraw the keys of agents and web nodes"),
    "pair": _Command(
        module="server.cli.pair", help="show a code and a PIN to pair one more device with a running server"
    ),
    "demo": _Command(module="server.cli.demo", help="run a simulated car, its bridge and the server in one process"),
    "simulate": _Command(module="server.cli.simulate", help="run a simulated car behind its own rosbridge server"),
    "replay": _Command(module="server.cli.replay", help="play a recording behind a rosbridge server, in real time"),
    "check": _Command(module="server.cli.check", help="run every check over recordings, faster than real time"),
    "verify": _Command(
        module="server.cli.verify", help="say whether recordings are as they were recorded, or where they are not"
    ),
    "export": _Command(module="server.cli.export", help="convert a recording, or a part of it, to another format"),
    "doctor": _Command(module="server.cli.doctor", help="list what a car publishes and how it maps to signals"),
    "health": _Command(module="server.cli.health", help="report the health of a running server"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; 0 done, 1 a finding, 2 cannot be done, 130 interrupted."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that has no × shows a question mark
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(prog="catgraph", description="Operator control unit for a test vehicle.")
    parser.add_argument("--version", action="version", version=f"catgraph {catgraph_version()}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    called = next((argument for argument in given if not argument.startswith("-")), None)
    for name, command in COMMANDS.items():
        sub = subparsers.add_parser(
            name, help=command.help, description=f"{command.help[0].upper()}{command.help[1:]}."
        )
        if name == called:
            module = importlib.import_module(command.module)
            module.add_arguments(sub)
            sub.set_defaults(run=module.run)
    args = parser.parse_args(given)
    logging.begin(getattr(args, "log_format", "text"), getattr(args, "log_level", "warning"))
    try:
        return int(args.run(args))
    except KeyboardInterrupt:
        return 130
