"""An HTTP client for tests, which waits longer than httpx does by itself: a busy machine is no failure."""

from __future__ import annotations

import ssl
from functools import cache
from typing import Any

import httpx

PATIENCE_S = 30.0


def http_client(**options: Any) -> httpx.AsyncClient:
    """A client with these options of httpx, that waits up to PATIENCE_S for each step of an answer."""
    usual: dict[str, Any] = {"timeout": PATIENCE_S, "verify": _context()}
    return httpx.AsyncClient(**usual | options)


@cache
def _context() -> ssl.SSLContext:
    """httpx's own: to read the certificates takes 40 ms, which each client would do."""
    return httpx.create_ssl_context()
