"""Where the broker between cars and web nodes is, and as whom a program comes to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where the broker is, and by what a program proves who it is."""

    address: str  # nats://HOST:4222 or tls://HOST:4222
    key: Path | None = None  # the file with the program's NKEY seed; None: the broker requires none
    authority: Path | None = None  # the certificate that signed the broker's, as PEM; None: those of the system


class BrokerRefused(ValueError):
    """The broker cannot be used as it was given; `str()` is one sentence."""
