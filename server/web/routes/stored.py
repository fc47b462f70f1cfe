"""Copies of recordings in the store over HTTP: requested, listed of all cars, and fetched through this server."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Body, HTTPException, Query, Request, Response
from fastapi import Path as InPath
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from server.protocol.answers import StoredCopy, StoredList
from server.recording.catalog.entries import NotThere, Refused
from server.recording.store.trouble import StoreTrouble
from server.web.interface import OF_KEPT, files, raises
from server.web.middleware.methods import is_head
from server.web.middleware.ranges import disposition
from server.web.services import services

# None of these routes is `async`: they ask the store and therefore run in threads.
router = APIRouter(tags=["recordings"], responses=raises(404, 409, 502))
copies = APIRouter(
    tags=["recordings"], responses=raises(*OF_KEPT, 409)
)  # of recordings: at a web node their agents answer
Id = Annotated[str, InPath(max_length=100, description="The recording's `id` in the list")]
Folder = Annotated[str, InPath(max_length=40, description="`folder` of the recording in the list")]
Name = Annotated[str, InPath(max_length=120)]
_KIND = "application/octet-stream"
T = TypeVar("T")


class UploadRequest(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    delete: bool = Field(False, description="Delete it on this machine, for good, once the copy was read back")


_USUAL = UploadRequest()


def _answered(what: Callable[[], T]) -> T:
    try:
        return what()
    except NotThere as why:
        raise HTTPException(404, str(why)) from None
    except Refused as why:
        raise HTTPException(409, str(why)) from None
    except StoreTrouble as why:
        raise HTTPException(502, str(why)) from None


@copies.post("/api/recordings/{id}/store", status_code=202, summary="Upload the whole file into the store")
def upload(request: Request, id: Id, body: Annotated[UploadRequest, Body()] = _USUAL) -> StoredCopy:
    """Answers at once; `stored` of the recording has the progress."""
    uploader = services(request).uploader
    if uploader is None:
        raise HTTPException(404, _no_store(request))
    _answered(lambda: uploader.ask(id, deletes=body.delete))
    return _copy(request, id)


@copies.delete("/api/recordings/{id}/store", summary="Upload the whole file no longer, and do not delete it here")
def withdraw(request: Request, id: Id) -> StoredCopy:
    """What is in the store stays there."""
    uploader = services(request).uploader
    if uploader is None:
        raise HTTPException(404, _no_store(request))
    _copy(request, id)  # 404 where there is none
    _answered(lambda: uploader.withdraw(id))
    return _copy(request, id)


@router.get("/api/stored", summary="The recordings in the store, of all cars, newest first, a page at a time")
def listed(
    request: Request,
    cursor: Annotated[str | None, Query(max_length=140, description="`next` of the page before")] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 50,
    vehicle: Annotated[str | None, Query(max_length=200)] = None,
) -> StoredList:
    stored = services(request).stored
    if stored is None:
        raise HTTPException(404, _no_store(request))
    return _answered(lambda: stored.page(vehicle=vehicle, cursor=cursor, limit=limit))


@router.get(
    "/api/stored/{folder}/{id}/file",
    responses=files(_KIND),
    summary="The whole file, from the store",
    response_class=Response,
)
def fetched(request: Request, folder: Folder, id: Id) -> Response:
    return _answer(request, lambda stored: stored.file(folder, id))


@router.get(
    "/api/stored/{folder}/{id}/clips/{name}",
    responses=files(_KIND),
    summary="A clip, from the store",
    response_class=Response,
)
def fetched_clip(request: Request, folder: Folder, id: Id, name: Name) -> Response:
    return _answer(request, lambda stored: stored.clip(folder, id, name))


def _answer(request: Request, find: Callable[[Any], Any]) -> Response:
    """Through this server and not by a signed address: who may read it is decided here, and the store need not be
    reachable from a phone."""
    stored = services(request).stored
    if stored is None:
        raise HTTPException(404, _no_store(request))
    file = _answered(lambda: find(stored))
    headers = {
        "Content-Length": str(file.size),
        "Content-Disposition": disposition(file.name),
        "Cache-Control": "private, no-cache",
    }
    if is_head(request):
        return Response(headers=headers, media_type=_KIND)
    portions = _answered(lambda: stored.read(file))
    return StreamingResponse(portions, headers=headers, media_type=_KIND)


def _copy(request: Request, id: str) -> StoredCopy:
    app = services(request)
    row = app.recordings.row(id) if app.recordings is not None else None
    if row is None or app.uploader is None:
        raise HTTPException(404, "There is no such recording.")
    return app.uploader.copy_of(row)


def _no_store(request: Request) -> str:
    app = services(request)
    if app.stored is not None and app.uploader is None:
        return app.where_kept()
    return "This server has no store: start it with --store s3://BUCKET/FOLDER."


router.include_router(copies)
