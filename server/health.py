"""`catgraph health`: asks a running server whether it is well; what a container's health check calls."""

from __future__ import annotations

import argparse
import json
import sys
import urllib.error
import urllib.request


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("url", nargs="?", default="http://127.0.0.1:8000", help="the server (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """0: well; 1: it does not answer, or not as catgraph does."""
    try:
        with urllib.request.urlopen(f"{args.url.rstrip('/')}/api/health", timeout=3) as answer:
            body = json.load(answer)
    except (urllib.error.URLError, OSError, ValueError) as why:
        print(f"catgraph: {args.url} does not answer: {getattr(why, 'reason', why)}", file=sys.stderr)
        return 1
    vehicles = body.get("vehicles")  # told only to who is known there
    print(f"catgraph {body.get('version')}: {body.get('status')}{f', {vehicles}' if vehicles else ''}")
    return 0 if body.get("status") == "ok" else 1
