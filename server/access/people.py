"""The list of people and who is on duty, of one server: the rules of server/control/duty.py files, listeners."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from server.access.identity import LOCAL, Principal
from server.access.people_files import DUTY_FILE, PEOPLE_FILE, PeopleFiles
from server.control import display_name
from server.control.duty import MOST_PEOPLE, DutyBoard, DutyEntry, Person
from server.protocol.people import ROLES, Duty, DutyState, PeopleList
from server.storage.storage_thread import StorageThread

log = logging.getLogger("catgraph.people")

MOST_LISTED = 20  # people on duty that are sent to a page
LONGEST_WAIT_S = 60.0  # a clock that is put forward ends a duty within a minute


def device_key(who: Principal, page: str | None) -> str | None:
    """Under which key somebody is on duty: of a paired device its id; of this machine's own pages that of the page.

    None: nobody can be on duty there, as at a program.
    """
    if who is LOCAL:
        return None if page is None else f"page-{page}"
    return None if who.is_program else who.id


class People:
    """Of one server. `wall_ms`: the time of day in ms since 1970."""

    def __init__(
        self, folder: Path | None, *, wall_ms: Callable[[], int], storage: StorageThread | None = None
    ) -> None:
        """`folder` None: it lasts as long as this run. `storage`: the thread that writes; None: the caller writes."""
        self._wall_ms = wall_ms
        self._storage = storage
        self._files = PeopleFiles(folder)
        self.board = DutyBoard()
        self._files.read(self.board)
        self._listeners: set[Callable[[], None]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self.on_changed: Callable[[], None] = lambda: None  # for what shares it with other servers
        self.complaint: str | None = self._files.complaint  # why what was kept could not be used

    # -- who is on duty ----------------------------------------------------------------------------------------------

    def sent(self, device: str | None) -> dict[str, Any]:
        """What is sent with every request of a device to a car: who is on duty there, and who is or was anywhere."""
        found = None if device is None else self.board.on_duty(device)
        duties = self.board.duties()
        names = [self.board.people[one.person or ""].name for one in duties if one.role == "supervisor"]
        return {
            "person": None if found is None else {"name": found.name, "role": found.role, "device": device},
            "supervisors": names[:MOST_LISTED],
            "duties": self.board.stated(self._wall_ms()),
            "listed": len(self.board.people),
        }

    def duty_of(self, device: str | None, device_name: str) -> Duty:
        """The duty message for a page of this device."""
        entry = None if device is None else self.board.entries.get(device)
        me = None if entry is None else self.state(entry)
        ended = entry.ended if entry is not None else None
        return {
            "kind": "duty",
            "me": me,
            "signs": device_name if me is None else display_name.with_person(me["name"], device_name),
            "ended": None if entry is None or ended is None else {"text": ended, "at_ms": entry.changed_ms},
            "people": len(self.board.people),
            "on_duty": [one for one in map(self.state, self.board.duties()[:MOST_LISTED]) if one is not None],
        }

    def state(self, entry: DutyEntry) -> DutyState | None:
        person = self.board.people.get(entry.person or "")
        if person is None:
            return None
        return {
            "person": person.id,
            "name": person.name,
            "role": entry.role,
            "title": ROLES[entry.role],
            "device": entry.device_name,
            "since_ms": entry.since_ms,
        }

    def listed(self, device: str | None) -> PeopleList:
        """Everybody, in the order of their last shift."""
        board = self.board
        rows = sorted(board.people.values(), key=lambda one: (-(one.last_ms or 0), one.name.casefold()))
        duties = {one.person: self.state(one) for one in board.duties()}
        entry = None if device is None else board.entries.get(device)
        return {
            "people": [
                {"id": one.id, "name": one.name, "role": one.role, "last_ms": one.last_ms, "duty": duties.get(one.id)}
                for one in rows
            ],
            "roles": [{"role": role, "title": title} for role, title in ROLES.items()],
            "ends_after_h": board.ends_after_h,
            "me": None if entry is None else self.state(entry),
        }

    # -- changes: each counts at once, and returns once the disk has it ------------------------------------------------

    async def add(self, name: object, role: object, *, returns: bool = False) -> str:
        """The id of the new person; `returns`: who was removed under this name. Raises Refused, OSError."""
        person = self.board.add(secrets.token_hex(4), name, role, self._wall_ms(), returns=returns)
        await self._keep(PEOPLE_FILE)
        return person.id

    async def change(self, id: str, *, name: object, role: object) -> None:
        """Raises Refused, OSError."""
        self.board.change(id, name=name, role=role, now_ms=self._wall_ms())
        await self._keep(PEOPLE_FILE)

    async def remove(self, id: str) -> None:
        """Raises Refused, OSError."""
        log_dropped(self.board.remove(id, self._wall_ms()))
        await self._keep(PEOPLE_FILE)

    async def set_hours(self, hours: float) -> None:
        """Raises Refused, OSError."""
        self.board.set_hours(hours, self._wall_ms())
        self._advance()
        await self._keep(PEOPLE_FILE, DUTY_FILE)

    async def sign_on(self, device: str, device_name: str, person: str, role: object, *, moves: bool) -> None:
        """Raises Refused, OSError: it counts, and a restart forgets it."""
        self.board.sign_on(device, device_name, person, role, self._wall_ms(), moves=moves)
        await self._keep(PEOPLE_FILE, DUTY_FILE)

    async def sign_off(self, device: str, why: str | None = None, *, ago_s: float = 0.0) -> None:
        """`ago_s`: how long ago the duty ended; one that began since then goes on. Raises OSError."""
        entry = self.board.entries.get(device)
        if ago_s and entry is not None and entry.since_ms > self._wall_ms() - ago_s * 1000:
            return
        if self.board.sign_off(device, self._wall_ms(), why):
            await self._keep(PEOPLE_FILE, DUTY_FILE)

    async def dismiss(self, device: str) -> None:
        """The note of how a duty ended was read. Raises OSError."""
        if self.board.dismiss(device, self._wall_ms()):
            await self._keep(DUTY_FILE)

    # -- life --------------------------------------------------------------------------------------------------------

    def watch(self, on_change: Callable[[], None]) -> Callable[[], None]:
        """Calls `on_change` after each change; answers how to end that."""
        self._listeners.add(on_change)
        return lambda: self._listeners.discard(on_change)

    def start(self) -> None:
        """From now on duties end by themselves."""
        self._advance()
        self._wait()

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def changed(self) -> None:
        """Something changed: all listeners are notified, and it is kept in the background."""
        for listener in list(self._listeners):
            listener()
        self.on_changed()
        self._wait()

    def keep_soon(self) -> None:
        """Write both files in the background; a full disk ends no duty."""
        for job in self._files.jobs(self.board, (PEOPLE_FILE, DUTY_FILE)):
            if self._storage is None:
                with contextlib.suppress(OSError):
                    job()
            else:
                self._storage.submit(job)

    async def _keep(self, *names: str) -> None:
        self.changed()
        for job in self._files.jobs(self.board, names):
            if self._storage is None:
                job()
            else:
                await self._storage.run(job)

    def _advance(self) -> None:
        if self.board.advance(self._wall_ms()):
            self.changed()
            self.keep_soon()

    def _wait(self) -> None:
        """Until the next duty ends."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            return  # nothing runs yet
        if self._timer is not None:
            self._timer.cancel()
        next_ms = self.board.next_ms()
        if next_ms is None:
            self._timer = None
            return
        left_s = max(0.0, (next_ms - self._wall_ms()) / 1000)
        self._timer = loop.call_later(min(left_s, LONGEST_WAIT_S), self._due)

    def _due(self) -> None:
        self._timer = None
        self._advance()
        self._wait()


def log_dropped(people: Iterable[Person]) -> None:
    """Log who is not stated as off duty any more: too many were removed within a few days."""
    for one in people:
        log.warning("removed_person_dropped name=%r off_ms=%s most=%d", one.name, one.off_ms, MOST_PEOPLE)


NOBODY = People(None, wall_ms=lambda: 0)  # of parts that are used without a server
