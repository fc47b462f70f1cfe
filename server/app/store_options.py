"""`--store` and what belongs to it on the command line. The login never stands there."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from server.app.config import Store
from server.recording.store.address import store_address


def add_arguments(parser: argparse.ArgumentParser, *, uploads: bool) -> None:
    """`uploads`: this command has recordings of its own."""
    what = "recordings are uploaded into it" if uploads else "recordings of all cars in it are listed"
    parser.add_argument("--store", metavar="s3://BUCKET/FOLDER", help=f"an S3-compatible store: {what}")
    parser.add_argument(
        "--store-endpoint",
        metavar="https://HOST:PORT",
        help="its address, if it is not Amazon's (default: AWS_ENDPOINT_URL)",
    )
    parser.add_argument("--store-region", metavar="REGION", help="its region (default: AWS_REGION, else us-east-1)")
    parser.add_argument(
        "--store-key",
        type=Path,
        metavar="FILE",
        help="its login: access_key_id and secret_access_key as TOML, mode 600 "
        "(default: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY)",
    )
    parser.add_argument(
        "--store-ca",
        type=Path,
        metavar="FILE",
        help="a certificate (PEM) to trust beside those of the system",
    )
    if uploads:
        parser.add_argument(
            "--depot-interface",
            metavar="wlan0",
            help="a network interface that is connected in the depot only (see Settings, Store)",
        )


def read(args: argparse.Namespace, environment: Mapping[str, str]) -> Store | None:
    """None: no store is named. Raises ValueError with one sentence."""
    interface: str | None = getattr(args, "depot_interface", None)
    if args.store is None:
        for name in ("store_endpoint", "store_region", "store_key", "store_ca"):
            if getattr(args, name) is not None:
                raise ValueError(f"--{name.replace('_', '-')} has no effect without --store.")
        if interface is not None:
            raise ValueError("--depot-interface has no effect without --store.")
        return None
    if find_spec("obstore") is None:
        raise ValueError("The client of the store is not installed: pip install 'catgraph[store]'.")
    if interface is not None and not re.fullmatch(r"[A-Za-z0-9_.-]{1,15}", interface):
        raise ValueError(f"“{interface[:40]}” is no name of a network interface.")
    if args.store_ca is not None and not args.store_ca.is_file():
        raise ValueError(f"There is no certificate {args.store_ca}.")
    address = store_address(
        args.store,
        endpoint=args.store_endpoint,
        region=args.store_region,
        key_file=args.store_key,
        authority=args.store_ca,
        environment=environment,
    )
    return Store(address=address, depot_interface=interface)
