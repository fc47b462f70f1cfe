"""The annotations of a recording, as they are stored: all texts and marks beside its file, voice notes and photos."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import NONE, Annotations
from server.recording.marks.recorded import late_media
from server.recording.store import names
from server.recording.store.object_store import ObjectStore


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotationSet:
    """What is beside a file. Another value: it was changed."""

    annotations: Annotations = NONE
    media: tuple[tuple[str, int, int], ...] = ()  # name, size and time of change


NOTHING = AnnotationSet()


def annotation_set(path: Path) -> AnnotationSet:
    """What is beside a recording now. Raises OSError."""
    stats = [(file.name, file.stat()) for file in late_media(path)]
    return AnnotationSet(
        annotations=annotation_store.read(path),
        media=tuple((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats),
    )


def send(store: ObjectStore, vehicle: str, id: str, path: Path) -> dict[str, Any] | None:
    """Put it all into the store; return the object of the texts and marks, for the row, None: there are none. Raises
    StoreTrouble, OSError."""
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
