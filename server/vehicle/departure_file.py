"""The list of the departure check that was edited for one car: a TOML file beside its settings."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path

from monitor.runner import Refused
from server.control import departure_list
from server.control.departure_list import MAX_BYTES, Item
from server.storage import durable_file
from server.storage.durable_file import set_aside

log = logging.getLogger("catgraph.settings")

LIST_SUFFIX = ".departure.toml"  # in place of that of the settings; no vehicle has a dot in its name


class DepartureFile:
    """Without a path it lasts as long as this run. Other programs may change the file: it is read at each start."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.items: tuple[Item, ...] | None = None  # None: there is none, the profile's list is in force
        self.complaint: str | None = None  # why what was found could not be used
        if path is not None:
            try:
                self.items = _read(path)
            except Refused as why:
                what = f"The departure check in {path.name} cannot be used; the usual list is in force."
                self.complaint = f"{what} {why.reason}"
                log.warning("departure list unusable: path=%s why=%s", path, why.reason)

    def write(self, items: Iterable[Item] | None) -> Path | None:
        """Store a list, or with None the profile's again; on any thread. Raises OSError.

        A file that cannot be used now is set aside first; return its new path.
        """
        path, aside = self._path, None
        if path is None:
            return None
        try:
            _read(path)
        except Refused as why:
            aside = set_aside(path)
            log.warning("departure list unusable, set aside: path=%s aside=%s why=%s", path, aside, why.reason)
        if items is None:
            path.unlink(missing_ok=True)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            durable_file.write(path, departure_list.to_toml(items).encode())
        return aside


def _read(path: Path) -> tuple[Item, ...] | None:
    """None: there is no file. Raises Refused: it cannot be used."""
    try:
        with open(path, "rb") as file:
            content = file.read(2 * MAX_BYTES + 1)
        return departure_list.from_toml(content.decode())
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise Refused("It is not UTF-8 text.") from None
    except OSError as why:
        raise Refused(f"It cannot be read: {why.strerror or why}.") from None
