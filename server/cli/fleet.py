"""`catgraph fleet`: who may use the broker between cars and web nodes."""

from __future__ import annotations

import argparse
import datetime
import sys
from pathlib import Path

from server.bus import broker_users
from server.bus.broker_users import FleetRefused, User

DEFAULT = Path("fleet")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--folder", type=Path, default=DEFAULT, help="where fleet.toml and fleet.conf are (default %(default)s)"
    )
    jobs = parser.add_subparsers(dest="job", required=True, metavar="JOB")
    add = jobs.add_parser("add", help="make a key for an agent or a web node, and print what to type there")
    add.add_argument("name", help="the vehicle's name, or the web node's")
    add.add_argument("--web", action="store_true", help="a web node, which may ask every agent")
    add.add_argument("--broker", default="tls://BROKER:4222", help="its address, for the lines that are printed")
    remove = jobs.add_parser("remove", help="withdraw a key")
    remove.add_argument("name")
    jobs.add_parser("list", help="who has a key, and since when")


def run(args: argparse.Namespace) -> int:
    """0 done, 2 refused."""
    try:
        if args.job == "list":
            return _list(args.folder)
        if args.job == "remove":
            gone = broker_users.remove(args.folder, args.name)
            print(f"{gone.name} was removed from {args.folder / broker_users.CONF}.")
        else:
            today = datetime.datetime.now(datetime.UTC).date().isoformat()
            added = broker_users.add(args.folder, args.name, "web" if args.web else "agent", today=today)
            for line in lines(*added, broker=args.broker):
                print(line)
    except FleetRefused as why:
        print(f"catgraph: {why}", file=sys.stderr)
        return 2
    print("Have the broker read its configuration again: nats-server --signal reload")
    return 0


def lines(user: User, seed: str, *, broker: str) -> list[str]:
    """What is typed on the car or at the node: the key, which is shown only now, and the command."""
    where = "On the car" if user.kind == "agent" else "At the web node"
    last = f"--vehicle {user.name}=ws://localhost:9090" if user.kind == "agent" else "--host 0.0.0.0"
    return [
        f"{where} (the key is shown only now):",
        f"  (umask 077; echo {seed} > {user.name}.key)",
        f"  catgraph {user.kind} --broker {broker} --key {user.name}.key {last}",
    ]


def _list(folder: Path) -> int:
    users = broker_users.read(folder)
    for user in users:
        print(f"{user.name:<24} {user.kind:<6} since {user.added}  {user.key}")
    if not users:
        print(f"Nobody has a key yet: catgraph fleet --folder {folder} add NAME")
    return 0
