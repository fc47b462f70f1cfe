"""Which vehicles a web node has heard: one whose agent is gone after a restart is shown as lost, not left out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import orjson

from server.storage import durable_file
from server.storage.storage_thread import StorageThread
from server.vehicle.vehicle import is_name

log = logging.getLogger("catgraph.web")

FILE = "vehicles.json"
MOST = 1000  # names from a broker without keys could be anything


class KnownVehicles:
    """Their names, in a file of the data folder."""

    def __init__(self, folder: Path | None, storage: StorageThread, *, forget: Sequence[str] = ()) -> None:
        """`folder` None: they last as long as this run. `forget`: those that are not listed any more, until heard."""
        self._path = None if folder is None else folder / FILE
        self._storage = storage
        self.names = self._read() - set(forget)

    def note(self, name: str) -> None:
        """It was heard; written without waiting for the disk."""
        if name in self.names or len(self.names) >= MOST or not is_name(name):
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
            log.warning("%s cannot be read; lost vehicles are not listed until they are heard: %s", self._path, why)
            return set()
