"""The departure check of one car: worked through by commands and by what is seen, logged, shown, and restored; and the
file of its edited list."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import assert_never

from monitor.runner import Refused
from server.control import departure_list
from server.control.authorization import Caller
from server.control.departure import Change, DepartureCheck
from server.control.departure_list import KINDS, MAX_BYTES, Item
from server.control.departure_sight import Peak, Seen
from server.judge.active_settings import ActiveSettings
from server.protocol import drive_commands, serialize
from server.protocol.alarm_state import Note
from server.protocol.departure import DepartureAnswer, DepartureItem, DepartureSignature, DepartureState
from server.storage import durable_file
from server.storage.durable_file import set_aside
from server.storage.storage_thread import StorageThread
from server.vehicle.restore import DeparturePast

log = logging.getLogger("catgraph.settings")

DRIVES_AFTER_S = 10.0  # moving for so long is a drive, not a push
MOVES_MPS = 0.5
WITHOUT = "The car drives without a signed departure check."
LIST_SUFFIX = ".departure.toml"  # in place of that of the settings; no vehicle has a dot in its name


class CarDeparture:
    """Of one vehicle; its session is the only writer. Times are on the session's monotonic clock, in seconds."""

    def __init__(self, settings: ActiveSettings, file: DepartureFile, note: Note) -> None:
        self._settings = settings
        self._file = file
        self._note = note
        self._check = DepartureCheck()
        self._moves_since_s: float | None = None
        self._is_without_logged = False
        self._changing = asyncio.Lock()  # of the list: one change after the other
        self._is_of_drive = False  # a car is monitored, or was when the server ended
        self._profile_rows: Sequence[object] = ()
        self._profile_items: tuple[Item, ...] = ()
        self._follow_list()

    @property
    def is_begun(self) -> bool:
        return self._check.id is not None

    @property
    def failed_items(self) -> dict[str, str]:
        """Id → title of what failed and was not mended."""
        return {one.id: one.title for one in self._check.items if self._check.result(one).result == "failed"}

    # -- time and drives ---------------------------------------------------------------------------------------------

    def tick(self, seen: Callable[[], Seen], now_s: float, wall_ms: int) -> None:
        """Time passes. `seen` is called where the check is open."""
        self._follow_list()
        if self.is_begun and self._check.signature is None:
            for change in self._check.look(seen(), now_s, wall_ms):
                self._log_change(change, wall_ms)

    def watch_drive(self, speed_mps: float | None, now_s: float) -> None:
        """Log a drive without a signed check once."""
        if speed_mps is None or abs(speed_mps) < MOVES_MPS:
            self._moves_since_s = None
            return
        if self._moves_since_s is None:
            self._moves_since_s = now_s
        if now_s - self._moves_since_s < DRIVES_AFTER_S or self._is_without_logged or self._check.signature is not None:
            return
        self._is_without_logged = True
        self._note("departure", WITHOUT, step="without")

    def dialled(self, wall_ms: int, *, resumed: bool, by: str | None) -> None:
        """A car is monitored from now on. What was begun for the drive before does not count for this one; what was
        begun while no car was monitored does. `resumed`: the drive continues after a restart of the server."""
        if self._is_of_drive and not resumed:
            self._moves_since_s, self._is_without_logged = None, False
            if self.is_begun:
                self._log_change(self._check.begin(_new_id(), by, wall_ms), wall_ms, by=by)
        self._is_of_drive = True

    def end_drive(self) -> None:
        """The car is no longer monitored: the next drive needs a new check."""
        self._check.end()
        self._moves_since_s, self._is_without_logged, self._is_of_drive = None, False, False

    def restore(self, past: DeparturePast) -> None:
        """The check of before a restart."""
        self._is_without_logged, self._is_of_drive = past.is_without_logged, past.is_of_drive
        if past.id is not None:
            self._check.restore(
                id=past.id, by=past.by, begun_ms=past.begun_ms, results=past.results, signature=past.signature
            )

    def _follow_list(self) -> None:
        """The list in force: the one that was edited, else that of the kind of car."""
        items = self._file.items or self._usual()
        if items is not self._check.items:
            self._check.change_list(items)

    def _usual(self) -> tuple[Item, ...]:
        rows = self._settings.profile.departure
        if not rows:
            return departure_list.USUAL
        if self._profile_rows is not rows:
            self._profile_rows, self._profile_items = rows, departure_list.of_rows(rows)
        return self._profile_items

    # -- commands ----------------------------------------------------------------------------------------------------

    async def execute(
        self,
        command: drive_commands.DepartureCommand,
        caller: Caller,
        wall_ms: int,
        storage: StorageThread | None = None,
    ) -> None:
        """`storage`: the thread that writes the list; None: the caller does. A list is kept and put in force though the
        caller waits no longer. Raises Refused, OSError."""
        check, by = self._check, caller.name
        match command:
            case drive_commands.BeginDeparture():
                self._log_change(check.begin(_new_id(), by, wall_ms), wall_ms, by=by)
            case drive_commands.SetDepartureItem():
                self._log_change(
                    check.set_item(command.item, command.result, command.note, by, wall_ms), wall_ms, by=by
                )
            case drive_commands.SignDeparture():
                role = caller.person.title if caller.person is not None else ""
                for change in check.sign(command.check, by, role, wall_ms):
                    self._log_change(change, wall_ms, by=by if change.step == "signed" else change.result.by)
            case drive_commands.ReopenDeparture():
                self._log_change(check.reopen(), wall_ms, by=by)
            case drive_commands.SetDepartureList():
                items = None if command.items is None else departure_list.of_rows(command.items)
                setting = asyncio.create_task(self._set_list(items, by, storage), name="set the departure list")
                await asyncio.shield(setting)
            case _:
                assert_never(command)

    async def _set_list(self, items: tuple[Item, ...] | None, by: str, storage: StorageThread | None) -> None:
        async with self._changing:
            if storage is None:
                aside = self._file.write(items)
            else:
                aside = await storage.run(lambda: self._file.write(items))
            self._file.items, self._file.complaint = items, None
            self._follow_list()
            what = "is the one of the vehicle profile again" if items is None else f"has {len(items)} items now"
            kept = "" if aside is None else f" What could not be used is kept in {aside.name}."
            self._note("settings", f"The list of the departure check {what}.{kept}", by=by, changes={})

    def _log_change(self, change: Change, moment_ms: int, *, by: str | None = None) -> None:
        check, counts = self._check, self._check.counts()
        match change.step:
            case "item":
                item, result = change.item, change.result
                assert item is not None
                labels = {"done": "done", "failed": "failed", "not_applicable": "not applicable", "open": "open again"}
                outcome = ": ".join(part for part in (labels[result.result], result.note or result.value) if part)
                self._note(
                    "departure",
                    f"Departure check, {item.title}: {outcome}.".replace("..", "."),
                    by=by,
                    step="item",
                    check=check.id or "",
                    moment_ms=moment_ms,
                    item=item.id,
                    item_title=item.title,
                    result=result.result,
                    value=result.value,
                    note=result.note,
                    hash=result.given_for,
                    **counts,
                )
            case "signed":
                assert check.signature is not None
                one = check.signature
                self._note(
                    "departure",
                    f"Departure check signed: {counts['done']} done, {counts['not_applicable']} not applicable.",
                    by=by,
                    step="signed",
                    check=check.id or "",
                    hash=one.hash,
                    fixed=one.fixed,
                    moment_ms=moment_ms,
                    recurring=check.recurring(),
                    **counts,
                )
            case _:
                texts = {"begun": "The departure check begins.", "reopened": "The departure check is open again."}
                id = check.id or ""
                text = texts[change.step]
                self._note("departure", text, by=by, step=change.step, check=id, moment_ms=moment_ms, **counts)

    # -- what others see ---------------------------------------------------------------------------------------------

    def state(self) -> DepartureState:
        """The `departure` of a state."""
        check, signature = self._check, self._check.signature
        return {
            "state": "none" if check.id is None else "open" if signature is None else "signed",
            **check.counts(),
            "by": check.by if signature is None else signature.by,
            "at_ms": check.begun_ms if signature is None else signature.at_ms,
        }

    def answer(self) -> DepartureAnswer:
        """The response of `GET /api/departure`."""
        return {
            **self.state(),
            "check": self._check.id,
            "items": [self._item(one) for one in self._check.items],
            "signature": self._signature(),
            "is_default": self._file.items is None,
            "complaint": self._file.complaint,
            "kinds": [
                {
                    "kind": name, "group": one.group, "title": one.title, "of": one.of, "unit": one.unit,
                    "need": one.need, "lowest": one.lowest, "highest": one.highest,
                }
                for name, one in KINDS.items()
            ],
            "toml": departure_list.to_toml(self._check.items),
        }  # fmt: skip

    def _item(self, item: Item) -> DepartureItem:
        result, peak = self._check.result(item), self._check.peaks.get(item.id, Peak())
        return {
            "id": item.id,
            "title": item.title,
            "kind": item.kind,
            "group": item.group,
            "of": item.of,
            "need": item.need,
            "unit": KINDS[item.kind].unit,
            "fix": item.fix,
            "every_days": item.every_days,
            "every_km": item.every_km,
            "result": result.result,
            "value": result.value or peak.value,
            "note": result.note,
            "by": result.by,
            "at_ms": result.at_ms,
            "is_fixed": result.is_fixed,
            "now": serialize.plain(peak.now, 2),
            "peak": serialize.plain(peak.highest, 2),
        }

    def _signature(self) -> DepartureSignature | None:
        one = self._check.signature
        if one is None:
            return None
        return {
            **one.counts,
            "by": one.by,
            "role": one.role,
            "at_ms": one.at_ms,
            "fixed": one.fixed,
            "hash": one.hash,
            "document": one.document,
        }


def _new_id() -> str:
    return secrets.token_hex(8)


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
