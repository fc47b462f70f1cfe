"""`catgraph health`: report the health of a running server; what a container's health check calls.

Without an address it requests this machine, by HTTPS and by HTTP. The certificate is not verified there: the server's
own authority signed it, and there is no network between two programs of one machine.
"""

from __future__ import annotations

import argparse
import contextlib
import ipaddress
import json
import ssl
import sys
import urllib.error
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

_HERE = ("https://127.0.0.1:8000", "http://127.0.0.1:8000")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("url", nargs="?", help=f"the server's address (default: {_HERE[0]}, then {_HERE[1]})")
    parser.add_argument(
        "--ca", type=Path, metavar="FILE", help="certificate authority of another machine's HTTPS: its ca.crt"
    )


def run(args: argparse.Namespace) -> int:
    """0: well, also where cars send nothing; 1: not well, no answer, or none of catgraph; 2: the authority cannot be
    read."""
    try:
        body = _ask((args.url,) if args.url else _HERE, args.ca)
    except _NoAnswer as why:
        print(f"catgraph: {why}", file=sys.stderr)
        return 1
    except OSError as why:
        print(f"catgraph: {args.ca} cannot be read: {why.strerror or why}.", file=sys.stderr)
        return 2
    vehicles = body.get("vehicles")  # present only for an authenticated client
    print(f"catgraph {body.get('version')}: {body.get('status')}{f', {vehicles}' if vehicles else ''}")
    for problem in body.get("problems", ()):
        print(f"  {problem}")
    for name, trouble in (body.get("lost") or {}).items():
        print(f"  {name}: {trouble}")
    return 0 if body.get("status") in ("ok", "cars lost") else 1


class _NoAnswer(Exception):
    """`str()` is one line for a person."""


def _ask(addresses: Sequence[str], ca: Path | None) -> dict[str, Any]:
    """The first answer. Raises _NoAnswer with why each did not, OSError where `ca` cannot be read."""
    failed = []
    for address in addresses:
        context = _context(address, ca)
        try:
            with urllib.request.urlopen(f"{address.rstrip('/')}/api/health", timeout=3, context=context) as answer:
                body = json.load(answer)
                if isinstance(body, dict):
                    return body
                failed.append(f"{address} is not a catgraph server")
        except urllib.error.HTTPError as refused:  # 503: it answers, and is not well
            with contextlib.suppress(ValueError), refused:
                body = json.load(refused)
                if isinstance(body, dict) and refused.code == 503 and "status" in body:
                    return body
            failed.append(f"{address} does not answer: {refused.reason}")
        except json.JSONDecodeError:
            failed.append(f"{address} is not a catgraph server")
        except (urllib.error.URLError, OSError, ValueError) as why:
            failed.append(f"{address} does not answer: {getattr(why, 'reason', why)}")
    raise _NoAnswer("; ".join(failed))


def _context(address: str, ca: Path | None) -> ssl.SSLContext | None:
    """What to trust at an address; None: nothing is encrypted there."""
    parts = urlsplit(address)
    if parts.scheme != "https":
        return None
    if ca is not None:
        return ssl.create_default_context(cafile=ca)
    context = ssl.create_default_context()
    if _is_here(parts.hostname or ""):
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    return context


def _is_here(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
