"""How one server is set up: what the command line and the environment decide before it starts."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A vehicle to watch; without an address it waits for one from the connect screen."""

    name: str
    address: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Everything `create_app` needs."""

    vehicles: tuple[Vehicle, ...] = (Vehicle(name="car"),)
    data: Path | None = None  # None: nothing is kept beyond this run
    host: str = "127.0.0.1"
    port: int = 8000
    allowed_hosts: tuple[str, ...] = ()  # non-empty: no other car is ever dialled
    found: tuple[Vehicle, ...] = field(default=())  # offered on the connect screen
    maps: tuple[Path, ...] = ()  # MBTiles under the map, the last on top
    site_image: Path | None = None  # above them; its corners stand in a .toml beside it


def vehicle_from_text(text: str, *, index: int) -> Vehicle:
    """`NAME=ws://car:9090` or only the address. Raises ValueError with one sentence."""
    name, separator, address = text.partition("=")
    if not separator or "://" in name:
        name, address = ("car" if index == 0 else f"car{index + 1}"), text
    if not name or not name.replace("-", "").replace("_", "").isalnum() or len(name) > 40:
        raise ValueError(f"“{name[:40]}” is no name for a vehicle: use letters, digits, - and _.")
    return Vehicle(name=name, address=address)
