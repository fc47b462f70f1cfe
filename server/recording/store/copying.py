"""What is done for one recording: its row, its clips, its file, the proof of the copy, and the deletion here.

Blocking: for the thread of the uploader. A part that is in the store is not sent again, whatever ends the server.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.protocol.answers import Recording
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import NONE, Annotations
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.discovery import why_not_one_file
from server.recording.catalog.entries import NotThere, Refused
from server.recording.marks.recorded import late_media
from server.recording.store import names, row
from server.recording.store.clips import ClipMaker
from server.recording.store.object_store import FileChanged, ObjectStore, Pace
from server.recording.store.plan import is_another
from server.recording.store.rules import moments_of
from server.recording.store.trouble import Kind, StoreTrouble
from server.recording.store.uploads import SentClip, SentPart, Upload, Uploads, Verified

ANOTHER = "The store has another recording of this name: rename this file."
_READ = 2**20
PROVED_FOR_MS = 10 * 60_000  # a copy that was read back longer ago is read back again before the file is deleted


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotationSet:
    """What is beside a file. Another value: it was changed."""

    annotations: Annotations = NONE
    media: tuple[tuple[str, int, int], ...] = ()  # name, size and time of change


NO_ANNOTATIONS = AnnotationSet()


def annotation_set(path: Path) -> AnnotationSet:
    """What is beside a recording now. Raises OSError."""
    stats = [(file.name, file.stat()) for file in late_media(path)]
    return AnnotationSet(
        annotations=annotation_store.read(path),
        media=tuple((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats),
    )


def send_annotations(store: ObjectStore, vehicle: str, id: str, path: Path) -> dict[str, Any] | None:
    """Put all that is beside a recording into the store; return the object of the texts and marks, for the row; None:
    there are none. Raises StoreTrouble, OSError."""
    for file in late_media(path):
        store.put(names.mark_key(vehicle, id, file.name), file.read_bytes())
    try:
        with annotation_store.beside(path).open("rb") as beside:
            body = beside.read(annotation_store.MAX_BYTES)
    except FileNotFoundError:
        return None
    key = names.annotations_key(vehicle, id)
    store.put(key, body)
    return {"name": key.rpartition("/")[2], "size": len(body), "sha256": hashlib.sha256(body).hexdigest()}


class NotTheSame(Exception):
    """The copy is not the file, or the file is not what it was. The text is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Copying:
    """The steps, in the order in which they are taken. Each raises StoreTrouble, and what the pace raises."""

    store: ObjectStore
    uploads: Uploads
    catalog: Catalog
    clips: ClipMaker
    wall_ms: Callable[[], int]

    def send_row(self, id: str) -> None:
        """The row, the alarms and the track. Raises Refused."""
        recording, upload = self.catalog.row(id), self.uploads.get(id)
        if recording is None:
            return
        self._put_row(recording, upload)

    def _put_row(self, recording: Recording, upload: Upload) -> AnnotationSet:
        """Its annotations, which are in the store from now on. Raises OSError too."""
        if is_another(recording, upload):
            raise Refused(ANOTHER)
        id, digest = recording["id"], row.digest_of(recording, upload)
        path = self.catalog.path(id)
        sent = NO_ANNOTATIONS if path is None else annotation_set(path)
        is_silent = sent == NO_ANNOTATIONS and _annotations(recording) == _annotations(None)
        if not upload.is_deleted or not is_silent:  # what came back may have lost them
            annotations = None if path is None else send_annotations(self.store, recording["vehicle"], id, path)
            self.store.put(names.row_key(recording["vehicle"], id), row.made(recording, upload, annotations))

        def keep(upload: Upload) -> None:
            upload.row = digest

        self.uploads.change(id, keep)
        return sent

    def send_clips(self, id: str, pace: Pace) -> None:
        """The time around each alarm that has none in the store yet."""
        recording, path = self._need(id)
        known = {clip.at_ms for clip in self.uploads.get(id).clips}
        for at_ms in moments_of([{**alarm} for alarm in recording.get("raised", [])]):
            if at_ms not in known:
                self._send_clip(recording, path, at_ms, pace)
        pace.check()
        self.uploads.change(id, lambda upload: setattr(upload, "clips_are_made", True))

    def _send_clip(self, recording: Recording, path: Path, at_ms: int, pace: Pace) -> None:
        with self.clips.made(path, recording["id"], at_ms) as clip:
            if clip is None:
                return  # nothing was recorded then
            key, size = names.clip_key(recording["vehicle"], recording["id"], at_ms), clip.stat().st_size
            with clip.open("rb") as file:
                sent = self.store.send(key, file, size, pace)
        self._compare(key, size, sent, pace)
        new = SentClip(key=key, size=size, sha256=sent, at_ms=at_ms)
        self.uploads.change(recording["id"], lambda upload: upload.clips.append(new))

    def _compare(self, key: str, size: int, sha256: str, pace: Pace) -> None:
        digest = hashlib.sha256()
        for portion in self.store.read(key, size, pace):
            digest.update(portion)
        if digest.hexdigest() != sha256:
            raise NotTheSame("A clip in the store is not what was sent.")

    def send_file(self, id: str, pace: Pace, on_share: Callable[[float], None]) -> None:
        """The parts of the file that are not there yet, then the proof. Raises FileChanged, NotTheSame, Refused,
        OSError."""
        recording, path = self._need(id)
        _need_one_file(path)
        self._need_same(id, path)
        with path.open("rb") as file:
            size, changed_ns = _shape(file.fileno())
            upload = self.uploads.change(id, lambda upload: _begin(upload, size, changed_ns))
            count = names.part_count(size)
            for number in range(1, count + 1):
                if number not in upload.parts:
                    on_share((number - 1) / count)
                    key = names.part_key(recording["vehicle"], id, recording["format"], number, count)
                    part_size = names.part_size(size, number)
                    file.seek((number - 1) * names.PART_BYTES)
                    sha256 = self.store.send(key, file, part_size, pace)
                    part = SentPart(key=key, size=part_size, sha256=sha256)
                    self.uploads.change(id, lambda upload, n=number, part=part: upload.parts.__setitem__(n, part))  # type: ignore[misc]
        on_share(1.0)
        self.prove(id, pace)
        self._sweep(recording, id)

    def prove(self, id: str, pace: Pace) -> Verified:
        """Reads the copy back and the file once more, and compares. Raises NotTheSame, FileChanged, OSError.

        Parts that are not the same are forgotten, so that they are sent again.
        """
        _, path = self._need(id)
        upload = self.uploads.get(id)
        with path.open("rb") as file:
            shape = _shape(file.fileno())
            if shape != (upload.size, upload.changed_ns):
                self.uploads.change(id, _forget_proof)
                raise FileChanged("The file changed after it was uploaded.")
            whole, bad = hashlib.sha256(), []
            for number in range(1, names.part_count(upload.size) + 1):
                here = hashlib.sha256()
                left = names.part_size(upload.size, number)
                while left and (portion := file.read(min(_READ, left))):
                    here.update(portion)
                    whole.update(portion)
                    left -= len(portion)
                if not self._is_there(upload.parts.get(number), here.hexdigest(), pace):
                    bad.append(number)
            if _shape(file.fileno()) != shape or _shape(path) != shape:
                raise FileChanged("The file changed while it was compared.")
        if bad:
            self.uploads.change(id, lambda upload: _forget_parts(upload, bad))
            listed = ", ".join(map(str, bad[:5])) + (" …" if len(bad) > 5 else "")
            raise NotTheSame(f"The copy in the store differs from the file (part {listed}); it is sent again.")
        proof = Verified(sha256=whole.hexdigest(), size=shape[0], changed_ns=shape[1], at_ms=self.wall_ms())
        self.uploads.change(id, lambda upload: setattr(upload, "verified", proof))
        return proof

    def _is_there(self, part: SentPart | None, sha256: str, pace: Pace) -> bool:
        """Whether the store has this part with this content."""
        if part is None:
            return False
        digest = hashlib.sha256()
        try:
            if self.store.size(part.key) != part.size:
                return False
            for portion in self.store.read(part.key, part.size, pace):
                digest.update(portion)
        except StoreTrouble as why:
            if why.kind is not Kind.MISSING:
                raise
            return False
        return digest.hexdigest() == sha256

    def delete_here(self, id: str, pace: Pace) -> None:
        """Deletes the recording on this machine for good, where its copy is proved and its annotations are in the
        store. Raises NotTheSame, FileChanged, Refused, OSError, and what the pace raises; then nothing was deleted.
        """
        _, path = self._need(id)
        _need_one_file(path)
        self._need_same(id, path)
        proof = self.uploads.get(id).verified
        if proof is None:
            raise NotTheSame("The copy was not verified.")
        if self.wall_ms() - proof.at_ms > PROVED_FOR_MS:
            proof = self.prove(id, pace)
        if _shape(path) != (proof.size, proof.changed_ns) or _digest(path) != proof.sha256:
            self.uploads.change(id, _forget_proof)
            raise FileChanged("The file changed after it was uploaded.")
        recording, _ = self._need(id)
        sent = self._put_row(recording, self.uploads.get(id))  # with the title and the note of now
        pace.check()
        with contextlib.suppress(NotThere):
            self._destroy(recording, sent, pace)

    def _destroy(self, recording: Recording, sent: AnnotationSet, pace: Pace) -> None:
        """Where nobody changed its annotations since its row was sent, and nobody withdrew the request."""
        moved = self.catalog.put_in_trash(recording["id"])
        try:
            pace.check()
            _need_one_file(self.catalog.folder / moved.path)
            now = annotation_set(self.catalog.folder / moved.path)
            is_as_sent = now == sent and _annotation_fields(now.annotations) == _annotations(recording)
            if is_as_sent:
                self.uploads.change(recording["id"], _note_deleted)
        except BaseException:
            self.catalog.put_back(moved)
            raise
        if is_as_sent:
            self.catalog.destroy_entry(moved)
        else:
            self.catalog.put_back(moved)  # its row is sent again, then this is done again

    def _need_same(self, id: str, path: Path) -> None:
        """The only copy of what was deleted here is not overwritten by another file of its name. Raises Refused."""
        upload = self.uploads.get(id)
        if not upload.is_deleted or upload.verified is None:
            return
        size, changed_ns = _shape(path)
        if size != upload.verified.size or _digest(path) != upload.verified.sha256:
            raise Refused(ANOTHER)
        if changed_ns != upload.changed_ns:
            self.uploads.change(id, lambda upload: _adopt(upload, changed_ns))

    def _need(self, id: str) -> tuple[Recording, Path]:
        """Raises FileChanged."""
        recording, path = self.catalog.row(id), self.catalog.path(id)
        if recording is None or path is None:
            raise FileChanged("The recording no longer exists.")
        return recording, path

    def _sweep(self, recording: Recording, id: str) -> None:
        """Objects of what the file was before it changed. One that stays does no harm."""
        known = {part.key for part in self.uploads.get(id).parts.values()}
        folder = names.folder_key(recording["vehicle"], id)
        with contextlib.suppress(StoreTrouble):
            for found in list(self.store.list(folder)):
                if found.key.startswith(f"{folder}{id}.{recording['format']}") and found.key not in known:
                    self.store.delete(found.key)


def _need_one_file(path: Path) -> None:
    """What belongs to a recording and is in no copy must not be deleted with it. Raises Refused."""
    if (what := why_not_one_file(path)) is not None:
        raise Refused(f"{what.capitalize()} is not uploaded.")


def _begin(upload: Upload, size: int, changed_ns: int) -> None:
    """Parts of another content are no parts of this one."""
    if (upload.size, upload.changed_ns) != (size, changed_ns):
        upload.parts, upload.verified = {}, None
        upload.size, upload.changed_ns = size, changed_ns


def _annotations(recording: Recording | None) -> tuple[str, str, str, tuple[str, ...]]:
    """As the row has them; None: of one without annotations."""
    if recording is None:
        return _annotation_fields(NONE)
    return recording["title"], recording["note"], recording["weather"], tuple(recording["tags"])


def _annotation_fields(beside: Annotations) -> tuple[str, str, str, tuple[str, ...]]:
    return beside.title, beside.note, beside.weather, beside.tags


def _note_deleted(upload: Upload) -> None:
    upload.is_deleted, upload.is_asked, upload.is_deletion_asked = True, False, False


def _adopt(upload: Upload, changed_ns: int) -> None:
    """The same content came back as another file."""
    upload.changed_ns = changed_ns
    if upload.verified is not None:
        upload.verified.changed_ns = changed_ns


def _forget_proof(upload: Upload) -> None:
    if not upload.is_deleted:  # else it records what the store has
        upload.verified = None


def _forget_parts(upload: Upload, bad: list[int]) -> None:
    upload.verified, upload.is_deleted = None, False  # the whole file is here
    for number in bad:
        upload.parts.pop(number, None)


def _shape(file: int | Path) -> tuple[int, int]:
    stat = os.stat(file)
    return stat.st_size, stat.st_mtime_ns


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


__all__ = ["Copying", "FileChanged", "NotTheSame", "Refused"]
