"""`--tls` and `--setup-port` on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path

from server.app.config import Tls


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--tls",
        nargs="+",
        metavar=("auto|off|CERT", "KEY"),
        help="auto: HTTPS by an authority of the server's own; off: plain HTTP; CERT KEY: HTTPS by these files (PEM), "
        "read again when they change (default: off on loopback, else auto)",
    )
    parser.add_argument(
        "--setup-port",
        type=int,
        metavar="PORT",
        help="port of the plain page with instructions for phones (default: after --port)",
    )


def read(args: argparse.Namespace) -> Tls | None:
    """The parsed options; None: none given. Raises ValueError with one sentence."""
    match args.tls, args.setup_port:
        case None, None:
            return None
        case None | ["auto"], port:
            return Tls(mode="auto", setup_port=port)
        case ["off"], None:
            return Tls(mode="off")
        case ["off"], _:
            raise ValueError("--setup-port has no effect with --tls off.")
        case [cert, key], port:
            return Tls(mode="files", cert=Path(cert), key=Path(key), setup_port=port)
    raise ValueError("--tls takes auto, off, or two files: the certificate and its key.")
