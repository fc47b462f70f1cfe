"""The marks of a recording, with those that came after it was complete, their voice notes and photos."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, HTTPException, Request, Response

from server.protocol.marks import MarkList
from server.recording.marks.media import TYPES, Kind
from server.recording.marks.recorded import read_marks, read_media
from server.web.interface import OF_KEPT, files, raises
from server.web.routes.marks import MarkOfPath, media_answer
from server.web.routes.recordings import Id, catalog
from server.web.routes.session_request import as_json

# None of these routes is `async`: they read a disk and therefore run in threads.
router = APIRouter(tags=["recordings"], responses=raises(*OF_KEPT))


@router.get(
    "/api/recordings/{id}/marks", response_model=MarkList, summary="Its marks, oldest first, late ones among them"
)
def listed(request: Request, id: Id) -> Response:
    try:
        return as_json({"marks": read_marks(_path(request, id))})
    except OSError as why:
        raise HTTPException(503, f"The file cannot be read: {why.strerror or why}.") from None


@router.get(
    "/api/recordings/{id}/marks/{mark}/voice",
    responses=files(*TYPES["voice"]),
    summary="The voice note of a mark",
    response_class=Response,
)
def voice(request: Request, id: Id, mark: MarkOfPath) -> Response:
    return _media(request, id, mark, "voice")


@router.get(
    "/api/recordings/{id}/marks/{mark}/photo",
    responses=files(*TYPES["photo"]),
    summary="The photo of a mark",
    response_class=Response,
)
def photo(request: Request, id: Id, mark: MarkOfPath) -> Response:
    return _media(request, id, mark, "photo")


def _media(request: Request, id: str, mark: str, kind: Kind) -> Response:
    try:
        found = read_media(_path(request, id), mark, kind)
    except OSError as why:
        raise HTTPException(503, f"The file cannot be read: {why.strerror or why}.") from None
    if found is None:
        raise HTTPException(404, f"This mark has no {kind}.")
    return media_answer(*found)


def _path(request: Request, id: str) -> Path:
    path = catalog(request).path(id)
    if path is None:
        raise HTTPException(404, "There is no such recording.")
    return path
