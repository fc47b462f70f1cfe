"""Keeps late marks and late descriptions of interventions beside their recordings, in the background: after each
recording that is complete, each mark that no recording covers, each intervention that somebody described, and once at
the start for what a killed server left."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from bisect import bisect_right
from collections.abc import Awaitable, Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.folder import FINISHED, WRITING, RecordingsFolder, id_of
from server.recording.marks import described as descriptions
from server.recording.marks.pending import PendingMedia
from server.recording.marks.rows import CHANGES, folded
from server.recording.marks.settle import BEFORE_MS, began_at, named_at, settle, settle_described

log = logging.getLogger("catgraph.recording")

FindEvents = Callable[..., Awaitable[list[dict[str, Any]]]]
MOST_EVENTS = 20_000  # of the log for one recording
LEFT_AT_START = 3  # newest recordings of each vehicle that are looked through at the start
DESCRIBED_AT_START = 20  # newest descriptions whose recordings are looked through then
MOST_INTERVENTIONS = 1000  # among which that of a description is looked for
MOST_PARTS = 30  # of a session that are looked through for one intervention
SETTLES_S = 0.3  # several marks within this time are handled together
TIDIES_S = 600.0  # between two searches for what waits for nothing, and new attempts of what failed
CLAIMED_MS = 60_000  # after so long no recording that begins takes a mark
_PORTION = 1000


class Late(NamedTuple):
    """What came after the part that it belongs to: a mark, or a description of an intervention."""

    vehicle: str
    moment_ms: int
    intervention: str = ""  # of a mark: none


class MarkKeeper:
    """Of one server. `vehicles`: the names of its cars; `find_events(vehicle, **filters)` reads their logs, newest
    first; `on_changed(path)` is called in a thread where files beside a recording changed."""

    def __init__(
        self,
        folder: RecordingsFolder,
        pending: PendingMedia,
        *,
        vehicles: Callable[[], tuple[str, ...]],
        find_events: FindEvents,
        on_changed: Callable[[Path], None],
        wall_ms: Callable[[], int],
    ) -> None:
        self._folder = folder
        self._pending = pending
        self._vehicles = vehicles
        self._find_events = find_events
        self._on_changed = on_changed
        self._wall_ms = wall_ms
        self._due: dict[Path, str] = {}  # recording → its vehicle
        self._complete: set[Path] = set()  # of those, what has just become complete
        self._late: set[Late] = set()
        self._failed: dict[Path, str] = {}  # what could not be done, to be tried again
        self._failed_late: set[Late] = set()
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._is_busy = False

    def start(self) -> None:
        """Begins with what the last run left."""
        self._is_busy = True
        self._task = asyncio.create_task(self._run(), name="late marks")

    async def stop(self) -> None:
        """What is not done is done at the next start."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def finished(self, path: Path) -> None:
        """A recording is complete, or what a killed server left of one could not be made complete."""
        vehicle = next((name for name in self._vehicles() if self._place(name) == path.parent), None)
        if vehicle is not None:
            self._due[path] = vehicle
            self._complete.add(path)
            self._wake.set()

    def late(self, vehicle: str, moment_ms: int, intervention: str = "") -> None:
        """A mark came whose moment no recording covers that is written, or an intervention of then was described."""
        self._late.add(Late(vehicle, moment_ms, intervention))
        self._wake.set()

    async def settled(self) -> None:
        """Returns once nothing is left to do; for tests and scripts."""
        while self._is_busy or self._due or self._late:  # noqa: ASYNC110
            await asyncio.sleep(0.02)

    # -- the work ----------------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        has_begun = await self._safely(self._begin())
        while True:
            if not self._due and not self._late:
                for vehicle in self._vehicles():
                    await self._safely(self._tidy(vehicle))
                self._is_busy = False
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._wake.wait(), TIDIES_S)
                self._wake.clear()
                self._is_busy = True
                await asyncio.sleep(SETTLES_S)
                has_begun = has_begun or await self._safely(self._begin())
                self._due, self._failed = self._failed | self._due, {}
                self._late, self._failed_late = self._failed_late | self._late, set()
            await self._find_late()
            while self._due:
                path, vehicle = self._due.popitem()
                if not await self._safely(self._settle(path, vehicle)):
                    self._failed[path] = vehicle
                if path in self._complete:  # its neighbours may have what is its, or lack what waited for it
                    if await self._safely(self._look_beside(path, vehicle)):
                        self._complete.discard(path)
                    else:  # and is tried again
                        self._failed[path] = vehicle

    async def _safely(self, work: Awaitable[None]) -> bool:
        try:
            await work
        except Exception:  # what cannot be kept beside one recording must not keep the others from it
            log.exception("late marks not stored")
            return False
        return True

    async def _tidy(self, vehicle: str) -> None:
        """Deletes what belongs to marks that were taken back, and puts aside what no recording will take."""
        files = await asyncio.to_thread(self._pending.files, vehicle)
        if not files:
            return
        marks, removed = await self._logged(vehicle)
        for name, path in files.items():
            if name.mark in removed and (taken := await asyncio.to_thread(self._pending.take, path)) is not None:
                await asyncio.to_thread(self._pending.remove, taken)
        is_troubled = vehicle in self._failed.values() or any(one.vehicle == vehicle for one in self._failed_late)
        if is_troubled or self._due or self._late:
            return
        writing = await asyncio.to_thread(self._recordings, vehicle, WRITING)
        until_ms = min([self._wall_ms() - CLAIMED_MS, *(named_at(path) - BEFORE_MS - 1000 for path in writing)])
        for name in await asyncio.to_thread(self._pending.waiting, vehicle):
            row = marks.get(name.mark)
            if name.mark not in removed and (row is None or row["marked_ms"] < until_ms):
                await asyncio.to_thread(self._pending.put_aside, vehicle, name)

    async def _begin(self) -> None:
        for vehicle in self._vehicles():
            for path in (await asyncio.to_thread(self._recordings, vehicle, FINISHED))[-LEFT_AT_START:]:
                self._due[path] = vehicle
            waiting = await asyncio.to_thread(self._pending.waiting, vehicle)
            if waiting:
                marks, _ = await self._logged(vehicle)
                self._late |= {Late(vehicle, marks[name.mark]["marked_ms"]) for name in waiting if name.mark in marks}
            self._late |= await self._described_last(vehicle)

    async def _find_late(self) -> None:
        """The recordings to which what came late may belong."""
        late, self._late = self._late, set()
        for vehicle in {one.vehicle for one in late}:
            mine = {one for one in late if one.vehicle == vehicle}
            if not await self._safely(self._find(vehicle, mine)):
                self._failed_late |= mine

    async def _find(self, vehicle: str, late: Iterable[Late]) -> None:
        found = await asyncio.to_thread(lambda: _parts_of(self._recordings(vehicle, FINISHED, WRITING), late))
        self._due |= dict.fromkeys(found, vehicle)

    async def _settle(self, path: Path, vehicle: str) -> None:
        since_ms = named_at(path) - BEFORE_MS - 1000  # names have whole seconds
        marks, removed = await self._logged(vehicle, since_ms=since_ms)
        with contextlib.suppress(FileNotFoundError):
            is_changed = await asyncio.to_thread(settle, path, marks, removed, pending=self._pending, vehicle=vehicle)
            described = await self._described(vehicle, since_ms=since_ms)
            if await asyncio.to_thread(settle_described, path, described) or is_changed:
                await asyncio.to_thread(self._on_changed, path)

    async def _logged(self, vehicle: str, **filters: Any) -> tuple[dict[str, DriveMark], set[str]]:
        """What the log has of the vehicle's marks."""
        return folded(await self._events(vehicle, CHANGES, **filters))

    async def _described(self, vehicle: str, **filters: Any) -> dict[str, InterventionDescription]:
        """What the log has on the vehicle's interventions, the newest of each."""
        return descriptions.newest(await self._events(vehicle, (descriptions.CHANGE,), **filters))

    async def _described_last(self, vehicle: str) -> set[Late]:
        """The interventions that were described last."""
        described = await self._find_events(vehicle, change=descriptions.CHANGE, limit=DESCRIBED_AT_START)
        if not described:
            return set()
        ids = {event.get("intervention") for event in described}
        found = await self._find_events(vehicle, change="intervention", limit=MOST_INTERVENTIONS)
        return {
            Late(vehicle, int(event.get("moment_ms") or event["at_ms"]), str(event["intervention"]))
            for event in found
            if event.get("intervention") in ids
        }

    async def _events(self, vehicle: str, changes: tuple[str, ...], **filters: Any) -> list[dict[str, Any]]:
        """Of these kinds, in the order of the log."""
        events: list[dict[str, Any]] = []
        for change in changes:
            before: int | None = None
            while len(events) < MOST_EVENTS:
                found = await self._find_events(vehicle, change=change, before=before, limit=_PORTION, **filters)
                events += found
                if len(found) < _PORTION:
                    break
                before = found[-1]["n"]
        return sorted(events, key=lambda event: event["n"])

    async def _look_beside(self, path: Path, vehicle: str) -> None:
        beside = await asyncio.to_thread(self._beside, path, vehicle)
        self._due = dict.fromkeys((path, *beside), vehicle) | self._due

    def _beside(self, path: Path, vehicle: str) -> list[Path]:
        """The finished recordings before and after this one, if there are any."""
        others = [one for one in self._recordings(vehicle, FINISHED) if one != path]
        at = bisect_right(others, _order(path), key=_order)
        return others[max(0, at - 1) : at + 1]

    def _recordings(self, vehicle: str, *endings: str) -> list[Path]:
        """In the order of their beginning."""
        place = self._place(vehicle)
        found = [path for path in place.iterdir() if path.name.endswith(endings)] if place.is_dir() else []
        return sorted(found, key=_order)

    def _place(self, vehicle: str) -> Path:
        return self._folder.place(vehicle, "x").parent


def _order(path: Path) -> tuple[int, int, str]:
    """Recordings by this are in the order of their beginning."""
    return named_at(path), len(id_of(path)), path.name


def _parts_of(recordings: list[Path], late: Iterable[Late]) -> set[Path]:
    """The finished recordings to which these may belong, of those of their vehicle in the order of their beginning.
    What is being written is settled when it is complete. Raises OSError."""
    found: set[Path] = set()
    for one in late:
        at = _last_begun(recordings, one.moment_ms)
        if one.intervention:
            holder = next((path for path in _looked_through(recordings, at) if _has(path, one.intervention)), None)
            found |= {holder} if holder is not None else set()
        else:
            found.update(recordings[max(0, at - 1) : at + 2])
    return {path for path in found if path.name.endswith(FINISHED)}


def _last_begun(recordings: list[Path], moment_ms: int) -> int:
    """The index of the last recording that had begun at a moment, -1: none. All parts of a session have its time in
    their names: when each began is read from it."""
    end = bisect_right(recordings, moment_ms, key=named_at)
    first = bisect_right(recordings, named_at(recordings[end - 1]) - 1, key=named_at) if end else 0
    return max(first, bisect_right(recordings, moment_ms, first, end, key=began_at) - 1) if end else -1


def _looked_through(recordings: list[Path], at: int) -> Iterator[Path]:
    """Where an intervention is looked for: the part of its moment, the one after, as it is logged a little later, and
    those of the session before."""
    if at < 0 or not recordings[at].name.endswith(FINISHED):
        return
    session = [path for path in recordings if named_at(path) == named_at(recordings[at])]
    at = session.index(recordings[at])
    for path in (*session[at : at + 2], *reversed(session[max(0, at - MOST_PARTS) : at])):
        if path.name.endswith(FINISHED):
            yield path


def _has(path: Path, intervention: str) -> bool:
    try:
        return descriptions.holds(path, intervention)
    except FileNotFoundError:  # deleted meanwhile
        return False
