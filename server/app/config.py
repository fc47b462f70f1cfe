"""How one server is set up: what the command line and the environment decide before it starts."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from server.access.credentials import Keys
from server.bus.broker import Broker
from server.protocol.rate_limit import Limits
from server.recording.store.address import StoreAddress
from server.system.loopback import is_loopback
from server.vehicle.vehicle import Vehicle
from server.web.maps.map_options import MapUpstream


@dataclass(frozen=True, slots=True, kw_only=True)
class Tls:
    """How the page is served: over HTTPS by a certificate of our own (auto) or a given one (files), or without."""

    mode: Literal["auto", "off", "files"] = "auto"
    cert: Path | None = None  # the chain as PEM, the server's certificate first; with mode files
    key: Path | None = None
    setup_port: int | None = None  # of the plain listener that explains; None: the one after `port`, 0: a free one


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """Where copies of recordings are."""

    address: StoreAddress
    depot_interface: str | None = None  # while it is connected, the car is in the depot


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
    site_image: Path | None = None  # above them; its corners are in a .toml beside it
    map_upstream: MapUpstream | None = None  # below the maps; None: no tile is ever fetched
    worker: bool = True  # phones store the page's shell; False: they delete it at the next visit
    names: tuple[str, ...] = ()  # what else this server is called: hosts, or origins (https://…) of a proxy before it
    keys: Keys = field(default_factory=Keys)  # of programs, where devices are paired
    tls: Tls | None = None  # None: off on loopback, else auto
    broker: Broker | None = None  # the vehicles are offered to web nodes there
    requires_signed: bool = True  # at a broker: orders that web nodes pass on are signed by the device that gives them
    known_devices: Path | None = None  # the list of devices whose orders count; None: those of any that signs
    is_node: bool = False  # a web node: the vehicles are those of agents at the broker, and `vehicles` has none
    expected: tuple[str, ...] = ()  # at a web node: vehicles that are listed before they send anything
    forgotten: tuple[str, ...] = ()  # at a web node: vehicles that were known once and are listed no more
    store: Store | None = None  # recordings are uploaded into it; at a web node those of all cars are listed
    limits: Limits = field(default_factory=Limits)
    next_steps: tuple[str, ...] = ()  # printed at the start below the addresses, a line each

    @property
    def is_open(self) -> bool:
        """Whether only programs of this machine can reach the server, which then needs no pairing."""
        return is_loopback(self.host)

    @property
    def is_tls(self) -> bool:
        """Whether the page is served over HTTPS."""
        return not self.is_open if self.tls is None else self.tls.mode != "off"


def default_data() -> Path:
    """The folder for what is kept, where none is named."""
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path.home() / ".local" / "share") / "catgraph"
