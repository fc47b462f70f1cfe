"""A TLS context whose certificate can be exchanged while it serves.

A new certificate gets its own context, which each new handshake uses, with or without a server name (browsers send
none for an address). A context changed in place could keep the old certificate beside the new one if their key types
differ.
"""

from __future__ import annotations

import ssl
from pathlib import Path


class LiveContext:
    """`ssl` is given to the server once; `use` exchanges what new connections are shown."""

    def __init__(self, cert: Path, key: Path | None = None) -> None:
        """Raises OSError, ssl.SSLError and ValueError as `use` does."""
        self.ssl = _context(cert, key)
        self._now = self.ssl
        self.ssl.sni_callback = self._lead

    def use(self, cert: Path, key: Path | None = None) -> None:
        """Shows new connections this chain. Raises OSError, ssl.SSLError or ValueError: then nothing has changed."""
        self._now = _context(cert, key)

    def _lead(self, connection: ssl.SSLObject, name: str | None, first: ssl.SSLContext) -> None:
        connection.context = self._now


def _context(cert: Path, key: Path | None) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # every browser since 2014 has it
    context.set_alpn_protocols(["http/1.1"])
    context.options |= ssl.OP_NO_TICKET  # a resumed session would keep the old certificate
    context.num_tickets = 0
    context.load_cert_chain(cert, key, password=_no_password)
    return context


def _no_password() -> str:
    raise ValueError("the key is protected by a password")
