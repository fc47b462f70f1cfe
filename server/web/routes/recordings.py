"""The recordings over HTTP: listed a page at a time, called by names, fetched, deleted and taken back."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import orjson
from fastapi import APIRouter, Body, HTTPException, Query, Request, Response
from fastapi import Path as InPath
from pydantic import BaseModel, ConfigDict, Field

from server.protocol.answers import ExportFormat, Recording, RecordingList, VerificationAnswer
from server.protocol.http_answers import Deleted, TrashList
from server.recording.catalog import sketch
from server.recording.catalog.annotations import BadAnnotation
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.catalog_db import Which
from server.recording.catalog.discovery import why_not_one_file
from server.recording.catalog.entries import NotThere, Refused
from server.recording.catalog.rows import MAX_ROWS
from server.recording.export.formats import FORMATS
from server.web.interface import OF_KEPT, UNCHANGED, files, raises
from server.web.middleware.errors import Problem
from server.web.middleware.ranges import file_answer
from server.web.services import services

# None of these routes is `async`: they read a disk and therefore run in threads.
router = APIRouter(tags=["recordings"], responses=raises(*OF_KEPT, 409))
Id = Annotated[str, InPath(max_length=100, description="The recording's `id` in the list")]
Text = Annotated[str | None, Query(max_length=200)]
Milliseconds = Annotated[int | None, Query(ge=-(2**53), le=2**53)]
_TYPES = {"mcap": "application/x-mcap", "bag": "application/x-rosbag", "db3": "application/vnd.sqlite3"}
_OTHER = "application/octet-stream"
T = TypeVar("T")


class AnnotationsChange(BaseModel):
    """What is left out stays as it is."""

    model_config = ConfigDict(extra="forbid", strict=True)
    title: str | None = Field(None, max_length=20_000, description="At most 120 letters; empty: called by its time")
    note: str | None = Field(None, max_length=20_000, description="At most 4000 letters")
    weather: str | None = Field(None, max_length=20_000, description="At most 120 letters, for the drive's report")
    tags: list[Annotated[str, Field(max_length=20_000)]] | None = Field(
        None, max_length=100, description="At most 20 of at most 40 letters; each once"
    )


def catalog(request: Request) -> Catalog:
    found: Catalog | None = services(request).recordings
    if found is None:
        raise HTTPException(404, services(request).where_kept())
    return found


def _answered(what: Callable[[], T]) -> T:
    try:
        return what()
    except NotThere as why:
        raise HTTPException(404, str(why)) from None
    except BadAnnotation as why:
        raise Problem(422, str(why), field=why.field) from None
    except Refused as why:
        raise HTTPException(409, str(why)) from None


def _json(request: Request, body: Any) -> Response:
    """304 if the list is unchanged, because an open list is requested repeatedly."""
    raw = orjson.dumps(body)
    headers = {"ETag": f'"{hashlib.sha256(raw).hexdigest()[:20]}"', "Cache-Control": "private, no-cache"}
    if headers["ETag"] in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return Response(raw, media_type="application/json", headers=headers)


@router.get(
    "/api/recordings",
    response_model=RecordingList,
    responses=UNCHANGED,
    summary="The recordings, newest first, a page at a time",
)
def listed(
    request: Request,
    cursor: Annotated[str | None, Query(max_length=120, description="`next` of the page before")] = None,
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS)] = 50,
    vehicle: Text = None,
    tag: Text = None,
    text: Annotated[str | None, Query(max_length=200, description="In title, note, tags, vehicle or name")] = None,
    since_ms: Milliseconds = None,
    until_ms: Milliseconds = None,
) -> Response:
    """`next` requests the following page; null: there is none. New recordings and copied files are listed by name until
    they have been read (`state` waiting)."""
    recordings = catalog(request)
    which = Which(vehicle=vehicle, tag=tag, text=text, since_ms=since_ms, until_ms=until_ms)
    recordings.look_again()
    page = _answered(lambda: recordings.rows(which, cursor=cursor, limit=limit))
    uploader = services(request).uploader
    if uploader is not None:
        for row in page.rows:
            row["stored"] = uploader.copy_of(row)
    free, names = recordings.free_bytes(), recordings.names()
    found: RecordingList = {
        "recordings": page.rows,
        "next": page.next,
        "found": recordings.totals(which),
        "all": recordings.totals(),
        "trash": recordings.totals(Which(is_trashed=True)),
        "free_bytes": None if free is None else free - free % 10_000_000,  # the same for a while: see ETag
        "waiting": recordings.waiting,
        "formats": listed_formats(),
        "vehicles": names["vehicles"],
        "tags": names["tags"],
    }
    if uploader is not None:
        found["store"] = uploader.facts()
    return _json(request, found)


def listed_formats() -> list[ExportFormat]:
    """The export formats as the page's keys show them."""
    return [
        {"name": form.name, "label": form.label, "use": form.use, "ros_version": form.ros_version}
        for form in FORMATS.values()
    ]


@router.post("/api/recordings/rescan", summary="Scan the folder again, and read again what could not be read")
def rescan(request: Request) -> Deleted:
    recordings = catalog(request)
    recordings.rebuild()
    return {"ok": True, **recordings.totals()}


@router.get(
    "/api/recordings/{id}",
    response_model=Recording,
    responses=UNCHANGED,
    summary="One recording, with the alarms that were raised in it",
)
def one(request: Request, id: Id) -> Response:
    row, uploader = catalog(request).row(id), services(request).uploader
    if row is None:
        raise HTTPException(404, "There is no such recording.")
    if uploader is not None:
        row["stored"] = uploader.copy_of(row)
    return _json(request, row)


@router.get(
    "/api/recordings/{id}/verify",
    summary="Verify its hash chain: whether it is as it was recorded",
)
def verify(request: Request, id: Id) -> VerificationAnswer:
    """Reads the whole file, which can take a minute; one recording at a time, otherwise 409."""
    recordings = catalog(request)
    return _answered(lambda: recordings.verify(id))


@router.patch(
    "/api/recordings/{id}",
    response_model=Recording,
    summary="Give it another title, note or tags",
)
def annotate(request: Request, id: Id, body: Annotated[AnnotationsChange, Body()]) -> Response:
    recordings = catalog(request)
    annotations = {"title": body.title, "note": body.note, "weather": body.weather}
    return _json(request, _answered(lambda: recordings.annotate(id, tags=body.tags, **annotations)))


@router.delete(
    "/api/recordings/{id}",
    response_model=Recording,
    summary="Into the trash; it stays there until the trash is emptied",
)
def delete(request: Request, id: Id) -> Response:
    recordings = catalog(request)
    return _json(request, _answered(lambda: recordings.delete(id)))


@router.get(
    "/api/recordings/{id}/file.mcap",
    responses=files(*_TYPES.values(), _OTHER, in_parts=True),
    summary="Its file as it is, whole or in part",
    response_class=Response,
)
def file(request: Request, id: Id) -> Response:
    """The recording's file; a copied one can be a ROS 1 bag or a db3 file, as its name shows."""
    recordings = catalog(request)
    row, path = recordings.row(id), recordings.path(id)
    if row is None or path is None:
        raise HTTPException(404, "There is no such recording.")
    if (what := why_not_one_file(path)) is not None:
        raise HTTPException(409, f"This recording is {what}: export it, or copy it from the disk.")
    name = f"{id} {row['title']}".strip() + f".{row['format']}"
    return file_answer(request, path, name=name, media_type=_TYPES.get(row["format"], _OTHER))


@router.get(
    "/api/recordings/{id}/track.svg",
    responses=files("image/svg+xml"),
    summary="Its track, with its alarms",
    response_class=Response,
)
def track(request: Request, id: Id) -> Response:
    row = catalog(request).row(id)
    if row is None:
        raise HTTPException(404, "There is no such recording.")
    drawn = sketch.from_json(row["sketch"])
    marks = 0 if drawn is None else len(drawn.marks)
    caption = (
        "No usable position was recorded"
        if drawn is None
        else f"The track, with {marks} alarm{'s' * (marks != 1)} on it"
    )
    return Response(
        sketch.svg(drawn, caption), media_type="image/svg+xml", headers={"Cache-Control": "private, max-age=60"}
    )


@router.get(
    "/api/trash",
    response_model=TrashList,
    responses=UNCHANGED,
    summary="What was deleted and can be taken back, deleted last first",
)
def trash(
    request: Request,
    cursor: Annotated[str | None, Query(max_length=120)] = None,
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS)] = 50,
) -> Response:
    recordings = catalog(request)
    which = Which(is_trashed=True)
    page = _answered(lambda: recordings.rows(which, cursor=cursor, limit=limit))
    return _json(request, {"recordings": page.rows, "next": page.next, "all": recordings.totals(which)})


@router.post("/api/trash/{id}/restore", response_model=Recording, summary="Restore")
def restore(request: Request, id: Id) -> Response:
    recordings = catalog(request)
    return _json(request, _answered(lambda: recordings.restore(id)))


@router.delete("/api/trash/{id}", summary="Delete it for good")
def destroy(request: Request, id: Id) -> Deleted:
    recordings = catalog(request)
    return {"ok": True, **_answered(lambda: recordings.destroy(id))}


@router.delete("/api/trash", summary="Empty the trash: delete all of it for good")
def empty(request: Request) -> Deleted:
    recordings = catalog(request)
    return {"ok": True, **_answered(lambda: recordings.destroy(None))}
