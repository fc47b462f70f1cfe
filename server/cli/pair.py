"""`catgraph pair`: a code and a PIN that let one more device into the server that runs on this machine."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from server.access import invitations
from server.access.access import FOLDER
from server.access.identity import Role
from server.access.invitations import LASTS_S
from server.app.banner import Pairing, invitation, pair_command
from server.app.config import default_data


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=Path, default=default_data(), help="data folder of the running server (default %(default)s)"
    )
    parser.add_argument("--viewer", action="store_true", help="pair a viewer (default: an operator)")


def run(args: argparse.Namespace) -> int:
    """0: it is shown; 2: no server runs that pairs devices, or its folder is not ours."""
    folder = args.data / FOLDER
    role = Role.VIEWER if args.viewer else Role.OPERATOR
    try:
        address = invitations.running_server(folder)
        if address is None:
            print(
                f"catgraph: no server with pairing uses the data folder {args.data}. It does when it is "
                "started with --host 0.0.0.0; on this machine alone nobody pairs.",
                file=sys.stderr,
            )
            return 2
        made = invitations.lay_invitation(folder, role, wall_ms=time.time_ns() // 1_000_000)
    except OSError as why:
        reason = why.strerror or why
        print(f"catgraph: the data folder {args.data} cannot be used: {reason}. Ask its owner.", file=sys.stderr)
        return 2
    pairing = Pairing(token=made.token, pin=made.pin, minutes=round(LASTS_S / 60), command=pair_command(args.data))
    shown = list(invitation(address, pairing, f"Pair {'a viewer' if args.viewer else 'an operator'}:"))
    if not sys.stdout.isatty():  # not a terminal: a code cannot be scanned
        shown = [shown[0], f"{address}#pair={made.token}"]
    print("\n".join(shown), flush=True)
    return 0
