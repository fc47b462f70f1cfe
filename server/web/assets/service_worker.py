"""The page's shell in a phone's cache: its files, its name, and the service worker.

Cached are only files whose address contains a hash of their content, and the page for an unreachable server.
Live data is never cached. With single modules, as during development, there is no worker, and an installed one removes
itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from server.version import catgraph_version
from server.web.assets.bundle import FOLDER, Built

WORKER, OFFLINE = "/worker.js", "/offline"
_MARKS = ("", "-critical", "-warning", "-lost", "-replay")
OF_OFFLINE = ("js/boot/offline.js",)
_SOURCES = "worker"  # in static/


@dataclass(frozen=True, slots=True, kw_only=True)
class Shell:
    """What one build of the page leaves on a phone."""

    version: str  # another content has another version
    build: str  # of the page it belongs to
    named: tuple[str, ...]  # addresses that hold the hash of what is behind them

    def worker(self, static: Path) -> str:
        """The script of the worker."""
        shell = {
            "version": self.version,
            "build": self.build,
            "named": self.named,
            "offline": f"{OFFLINE}?v={self.version}",
        }
        return f"self.SHELL = {json.dumps(shell)};\n{_script(static, 'worker')}"


def build_of(built: Built | None) -> str:
    """The name of the current bundle; "" for single modules, which have no version."""
    return "" if built is None else f"{catgraph_version()}-{built.name}"


def shell_of(static: Path, built: Built, asset: Callable[[str], str], offline: bytes) -> Shell:
    """What to keep of the page `built`; `offline` is the page for when the server does not answer, as it is sent."""
    joined = sorted(path for path in (static / FOLDER).iterdir() if path.suffix in (".js", ".css", ".woff2"))
    named = (
        *(f"/static/{FOLDER}/{path.name}" for path in joined),
        *(asset(name) for name in OF_OFFLINE),
        *(asset(f"icons/catgraph{mark}.svg") for mark in _MARKS),
    )
    digest = hashlib.sha256(repr((named, build_of(built))).encode() + offline)
    digest.update(_script(static, "worker").encode())
    return Shell(version=digest.hexdigest()[:12], build=build_of(built), named=named)


def withdrawn(static: Path) -> str:
    """The script that takes away what an earlier worker left, and then itself."""
    return _script(static, "withdrawn")


def _script(static: Path, name: str) -> str:
    return (static / _SOURCES / f"{name}.js").read_text(encoding="utf-8")
