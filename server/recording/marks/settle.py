"""Makes a finished recording's marks, and the descriptions of its interventions, those of the log: what it does not
hold, or holds otherwise, is kept beside it."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Mapping
from pathlib import Path

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.discovery import started_ms_of
from server.recording.folder import FINISHED, WRITING
from server.recording.marks import described as descriptions
from server.recording.marks import media
from server.recording.marks.media import MediaName
from server.recording.marks.pending import PendingMedia
from server.recording.marks.recorded import NOTHING, InFile, attached, in_file
from server.recording.marks.rows import has_same_content
from server.storage import durable_file

log = logging.getLogger("catgraph.recording")

MOST_BEFORE = 20  # recordings that are looked at for the one before
_HEAD_BYTES = 128 * 1024
_STARTED = re.compile(rb"\x0a\0\0\0started_ms\x0d\0\0\0(\d{13})")  # in the metadata: each text after its length

BEFORE_MS = 10_000  # a mark so shortly before a recording began belongs to it, unless it belongs to the one before
AFTER_MS = 30_000  # a mark that came so soon after the end of a recording belongs to it, where no other one began


def settle(
    path: Path,
    logged: Mapping[str, DriveMark],
    removed: Collection[str],
    *,
    pending: PendingMedia | None = None,
    vehicle: str = "",
) -> bool:
    """Whether anything was changed. `logged`: what the log has of the marks of the vehicle. Raises OSError."""
    found = in_file(path)
    mine = {mark: row for mark, row in logged.items() if mark in found.marks or _covers(path, found, row["marked_ms"])}
    beside = annotation_store.read(path)
    late = {row["mark"]: row for row in beside.marks}
    for mark, row in mine.items():
        if has_same_content(row, found.marks.get(mark)):
            late.pop(mark, None)
        elif not has_same_content(row, late.get(mark)):
            late[mark] = row
    # A recording that came later has them; of a file that cannot be read nothing is known.
    others = [] if found is NOTHING else [mark for mark in late if mark in logged and mark not in mine]
    if pending is not None:
        _give_back(path, others, pending, vehicle)
    for mark in others:
        late.pop(mark)
    gone = {mark for mark in (*found.marks, *late) if mark in removed} | set(beside.removed)
    for mark in gone:
        late.pop(mark, None)
    is_changed = annotation_store.write_marks(path, list(late.values()), sorted(gone))
    if pending is not None:
        is_changed = (
            _settle_media(path, found, {*mine, *found.marks}.difference(removed), pending, vehicle) or is_changed
        )
    return is_changed


def settle_described(path: Path, logged: Mapping[str, InterventionDescription]) -> bool:
    """As `settle`, of interventions: each is in the recording that holds it. `logged`: the newest description of each
    of the vehicle. Raises OSError."""
    beside = annotation_store.read(path).described
    if not logged and not beside:
        return False
    late = descriptions.late_of(path, logged)
    if late is None:
        return False
    kept = [row for row in beside if row["intervention"] not in logged]  # older than what is left of the log
    return annotation_store.write_described(path, [*kept, *late])


def _covers(path: Path, found: InFile, marked_ms: int) -> bool:
    """Whether a moment belongs to a recording: it is in it, or so near that no other has a better claim."""
    if found.start_ms <= marked_ms <= found.end_ms:
        return True
    is_after = found.end_ms < marked_ms <= found.end_ms + AFTER_MS
    is_before = found.start_ms - BEFORE_MS <= marked_ms < found.start_ms
    if not is_after and not is_before:
        return False
    began, named_ms = began_at(path), named_at(path)
    others = [other for other in path.parent.iterdir() if other != path and other.name.endswith((FINISHED, WRITING))]
    if is_after:
        later = [other for other in others if named_ms <= named_at(other) <= marked_ms]
        return not any(began < began_at(other) <= marked_ms for other in later)
    if began <= marked_ms:  # it began, and nothing came yet
        return True
    earlier = sorted((other for other in others if named_at(other) <= named_ms), key=named_at)[-MOST_BEFORE:]
    before = max((other for other in earlier if began_at(other) < began), key=began_at, default=None)
    if before is not None and before.name.endswith(WRITING):  # it may hold the mark: known once it is complete
        return False
    return before is None or in_file(before).end_ms + AFTER_MS < marked_ms


def named_at(path: Path) -> int:
    """When a recording's session began, by its name [ms since 1970], in whole seconds; its parts began later."""
    return started_ms_of(None, path.name, 0)


def began_at(path: Path) -> int:
    """When a recording began [ms since 1970], by the beginning of the file, else by its name."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError:
        return named_at(path)
    found = _STARTED.search(head)
    return int(found[1]) if found is not None else named_at(path)


def _give_back(path: Path, marks: Collection[str], pending: PendingMedia, vehicle: str) -> None:
    """The voice notes and photos beside a recording that belong to marks of another one wait for that."""
    folder = annotation_store.media_beside(path)
    for mark in marks:
        for kind in media.KINDS:
            file = media.find(folder, mark, kind)
            name = media.name_of(file.name) if file is not None else None
            if file is not None and name is not None:
                if pending.read(vehicle, mark, kind) is None:  # else another came since
                    pending.keep(vehicle, name, file.read_bytes())
                file.unlink(missing_ok=True)


def _settle_media(path: Path, found: InFile, marks: Collection[str], pending: PendingMedia, vehicle: str) -> bool:
    """What the file holds need not wait any more; what it does not is put beside it."""
    waiting = {name: file for name, file in pending.files(vehicle).items() if name.mark in marks}
    if not waiting:
        return False
    held: dict[MediaName, list[bytes]] = {}
    for name, data in attached(path) if found.media else ():
        held.setdefault(name, []).append(data)
    is_changed = False
    for name, file in waiting.items():
        taken = pending.take(file)
        if taken is None:
            continue
        if held.get(name, [b""])[0] != taken.data:  # the newest one
            folder = annotation_store.media_beside(path)
            folder.mkdir(exist_ok=True)
            old = media.find(folder, name.mark, name.kind)
            durable_file.write(folder / name.file, taken.data)
            if old is not None and old.name != name.file:
                old.unlink(missing_ok=True)
        durable_file.sync_folder(path.parent)
        pending.remove(taken)
        is_changed = True
    return is_changed
