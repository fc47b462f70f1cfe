"""Vehicles that a web node lists without their agents: those known from before, and those that are off on purpose.

One whose agent is gone after a restart is shown as lost, not left out. One that a person declared off on
purpose is not lost, until its agent sends data again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import orjson
from pydantic import TypeAdapter, ValidationError

from server.protocol.cars_state import OffOnPurpose
from server.storage import durable_file
from server.storage.storage_thread import StorageThread
from server.vehicle.vehicle import is_name

log = logging.getLogger("catgraph.web")

FILE = "vehicles.json"
MOST = 1000  # names from a broker without keys could be anything

OFF_FILE = "off.json"
MOST_OFF = 1000
_OFF_FILE: TypeAdapter[dict[str, OffOnPurpose]] = TypeAdapter(dict[str, OffOnPurpose])


class KnownVehicles:
    """Vehicles whose agents have sent something to a web node.

    Their names, in a file of the data folder.
    """

    def __init__(self, folder: Path | None, storage: StorageThread, *, forget: Sequence[str] = ()) -> None:
        """`folder` None: they last as long as this run. `forget`: those that are not listed until they send data."""
        self._path = None if folder is None else folder / FILE
        self._storage = storage
        self.names = self._read() - set(forget)
        self._has_warned = False

    def note(self, name: str) -> None:
        """It sent something; written without waiting for the disk."""
        if name in self.names or not is_name(name):
            return
        if len(self.names) >= MOST:
            if not self._has_warned:
                log.warning("vehicle_not_stored vehicle=%s most=%d: once lost, more are not listed", name, MOST)
            self._has_warned = True
            return
        self.names.add(name)
        if self._path is not None:
            self._storage.submit(partial(durable_file.write, self._path, orjson.dumps(sorted(self.names))))

    def _read(self) -> set[str]:
        """Where the file cannot be read the names come again with their agents."""
        if self._path is None:
            return set()
        try:
            found = orjson.loads(self._path.read_bytes())
            return {name for name in found[:MOST] if is_name(name)}
        except FileNotFoundError:
            return set()
        except (OSError, ValueError, TypeError, AttributeError) as why:
            log.warning("%s cannot be read; lost vehicles are not listed until they send data: %s", self._path, why)
            return set()


class OffVehicles:
    """Cars that a person declared off on purpose.

    By their names, in a file of the data folder.
    """

    def __init__(self, folder: Path | None, storage: StorageThread, *, wall_ms: Callable[[], int]) -> None:
        """`folder` None: they last as long as this run."""
        self._path = None if folder is None else folder / OFF_FILE
        self._storage = storage
        self._wall_ms = wall_ms
        self._off = self._read()

    @property
    def names(self) -> frozenset[str]:
        return frozenset(self._off)

    def of(self, name: str) -> OffOnPurpose | None:
        """Who declared it off and when; None: nobody."""
        return self._off.get(name)

    def declare(self, name: str, by: str) -> bool:
        """A person declares it off. Written without waiting for the disk. False: no more can be stored."""
        if name in self._off:
            return True
        if len(self._off) >= MOST_OFF:
            return False
        self._off[name] = {"by": by, "since_ms": self._wall_ms()}
        log.info("car_off vehicle=%s by=%s", name, by)
        self._write()
        return True

    def withdraw(self, name: str, by: str) -> None:
        """A person declares that it is not off."""
        if self._off.pop(name, None) is not None:
            log.info("car_not_off vehicle=%s by=%s", name, by)
            self._write()

    def end_by_data(self, name: str) -> None:
        """Its agent sent something: it is on, whatever a person declared before."""
        if self._off.pop(name, None) is not None:
            log.info("car_heard_again vehicle=%s", name)
            self._write()

    def _write(self) -> None:
        if self._path is not None:
            self._storage.submit(partial(durable_file.write, self._path, orjson.dumps(self._off)))

    def _read(self) -> dict[str, OffOnPurpose]:
        """Where the file cannot be read the cars are lost: that is shown, and a person declares them off again."""
        if self._path is None:
            return {}
        try:
            found = _OFF_FILE.validate_json(self._path.read_bytes())
            return {name: off for name, off in found.items() if is_name(name)}
        except FileNotFoundError:
            return {}
        except (OSError, ValidationError) as why:
            log.warning("%s cannot be read; cars that are off on purpose are shown as lost: %s", self._path, why)
            return {}
