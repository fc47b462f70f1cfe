"""Where the list of people and the duties are kept: two small TOML files in the data folder.

`people.toml` may be edited by hand while the server is stopped. What cannot be used is set aside, never overwritten.
"""

from __future__ import annotations

import errno
import logging
import secrets
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import tomli_w

from monitor.runner import Refused
from server.control import display_name
from server.control.duty import (
    MOST_DUTIES,
    MOST_FORMER,
    MOST_PEOPLE,
    DutyBoard,
    DutyEntry,
    Person,
    person_name,
    role_of,
)
from server.storage import bounded_toml, durable_file
from server.storage.durable_file import set_aside

log = logging.getLogger("catgraph.people")

FOLDER = "people"
PEOPLE_FILE = "people.toml"
DUTY_FILE = "duty.toml"
_TIMES = 2**53
_BAD = (Refused, ValueError, TypeError, KeyError, AttributeError)  # what a row that cannot be used raises
_MAX_BYTES = 2 * bounded_toml.MAX_BYTES  # full lists of long names, each letter of four bytes


class PeopleFiles:
    """In a folder of their own; `folder` None: nothing is kept."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = None if folder is None else folder / FOLDER
        self._blocked: set[str] = set()  # names of files that cannot be read, and could not be set aside
        self.complaint: str | None = None

    def read(self, board: DutyBoard) -> None:
        """Fills the board with what was kept; a data folder of before has none of it."""
        if self._folder is None:
            return
        for name, take in ((PEOPLE_FILE, _take_people), (DUTY_FILE, _take_duties)):
            path = self._folder / name
            try:
                with open(path, "rb") as file:
                    content = file.read(_MAX_BYTES + 1)
                take(board, bounded_toml.loads(content, max_bytes=_MAX_BYTES))
            except FileNotFoundError:
                continue
            except OSError as why:
                self._complain(f"{name} cannot be read ({why.strerror or why}){self._set_aside(path)}.")
            except (bounded_toml.BadToml, *_BAD) as why:
                sentence = why.reason if isinstance(why, Refused) else str(why)
                self._complain(f"{name} cannot be used{self._set_aside(path)}: {sentence[:200]}")

    def _set_aside(self, path: Path) -> str:
        """Set aside a file that cannot be used; return what became of it, as the end of a sentence."""
        try:
            return f" and is kept as {set_aside(path).name}"
        except OSError:
            self._blocked.add(path.name)
            return " and stays as it is: what changes lasts until a restart"

    def _complain(self, sentence: str) -> None:
        log.error("people_not_read %s", sentence)
        self.complaint = f"The list of people: {sentence}"

    def jobs(self, board: DutyBoard, names: Sequence[str]) -> list[Callable[[], None]]:
        """What writes the files as the board is now, each for any thread. They raise OSError."""
        if self._folder is None:
            return []
        made: Mapping[str, Callable[[DutyBoard], dict[str, Any]]] = {PEOPLE_FILE: _people, DUTY_FILE: _duties}
        return [partial(self._write, self._folder / name, made[name](board)) for name in names]

    def _write(self, path: Path, content: Mapping[str, Any]) -> None:
        if path.name in self._blocked:
            raise OSError(errno.EIO, f"{path.name} could not be read, and is not overwritten")
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        durable_file.write(path, tomli_w.dumps(content).encode(), mode=0o600)


def _people(board: DutyBoard) -> dict[str, Any]:
    return {
        "ends_after_h": board.ends_after_h,
        "changed_ms": board.hours_changed_ms,
        "people": [_row(one) for one in board.people.values()],
        "gone": [_row(one) for one in board.gone.values()],
        "removed": board.removed,
    }


def _row(one: Person) -> dict[str, Any]:
    row: dict[str, Any] = {"id": one.id, "name": one.name, "role": one.role, "changed_ms": one.changed_ms}
    row |= {name: at_ms for name in ("last_ms", "off_ms") if (at_ms := getattr(one, name)) is not None}
    return row | ({"former": list(one.former)} if one.former else {}) | ({"was": one.was} if one.was else {})


def _duties(board: DutyBoard) -> dict[str, Any]:
    rows = []
    for one in board.entries.values():
        row: dict[str, Any] = {"device": one.device, "device_name": one.device_name, "changed_ms": one.changed_ms}
        if one.person is not None:
            row |= {"person": one.person, "role": one.role, "since_ms": one.since_ms}
        if one.ended is not None:
            row["ended"] = one.ended
        rows.append(row)
    return {"duties": rows}


def _take_people(board: DutyBoard, found: Mapping[str, Any]) -> None:
    board.set_hours(float(found.get("ends_after_h", board.ends_after_h)), time_ms(found.get("changed_ms", 0)))
    board.removed = {str(id)[:60]: time_ms(at_ms) for id, at_ms in found.get("removed", {}).items()}
    for row in found.get("people", [])[:MOST_PEOPLE]:
        person = person_of(str(row.get("id") or secrets.token_hex(4)), row)
        board.people[person.id] = person
    for row in found.get("gone", [])[-MOST_PEOPLE:]:
        try:
            person = person_of(row["id"], row)
        except _BAD as why:  # the list itself can be used
            log.error("removed_person_not_read why=%r", str(why)[:200])
            continue
        board.gone[person.id] = person


def _take_duties(board: DutyBoard, found: Mapping[str, Any]) -> None:
    for row in found.get("duties", [])[: 2 * MOST_DUTIES]:
        entry = entry_of(str(row["device"]), row)
        board.entries[entry.device] = entry


def person_of(id: str, row: Mapping[str, Any]) -> Person:
    """Raises Refused, ValueError, TypeError, KeyError where it is none."""
    last_ms, off_ms, was = row.get("last_ms"), row.get("off_ms"), row.get("was")
    return Person(
        id=entry_id(id),
        name=person_name(row["name"]),
        role=role_of(row.get("role", "operator")),
        last_ms=None if last_ms is None else time_ms(last_ms),
        off_ms=None if off_ms is None else time_ms(off_ms),
        former=tuple(person_name(one) for one in row.get("former", ())[:MOST_FORMER]),
        changed_ms=time_ms(row.get("changed_ms", 0)),
        was=None if was is None else entry_id(was),
    )


def entry_of(device: str, row: Mapping[str, Any]) -> DutyEntry:
    """Raises as `person_of`."""
    person, ended = row.get("person"), row.get("ended")
    return DutyEntry(
        device=entry_id(device),
        device_name=display_name.clean(row.get("device_name")) or "a device",
        changed_ms=time_ms(row["changed_ms"]),
        person=None if person is None else entry_id(person),
        role=role_of(row.get("role", "operator")),
        since_ms=time_ms(row.get("since_ms", 0)),
        ended=None if ended is None else str(ended)[:200],
    )


def entry_id(found: object) -> str:
    """Raises ValueError."""
    if not isinstance(found, str) or not 0 < len(found) <= 60 or not found.replace("-", "").isalnum():
        raise ValueError("an id is none")
    return found


def time_ms(found: object) -> int:
    """Raises ValueError."""
    if type(found) is not int or not 0 <= found < _TIMES:
        raise ValueError("a time is none")
    return found
