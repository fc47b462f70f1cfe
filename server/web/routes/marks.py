"""The marks of this drive, with their voice notes and photos."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi import Path as InPath
from pydantic import Field

from server.protocol.drive_commands import MARK
from server.protocol.marks import DriveMark, MarkList
from server.recording.marks import media
from server.recording.marks.media import TYPES, BadMedia, Kind, MediaName
from server.recording.marks.pending import NoRoom
from server.recording.marks.recorded import read_media
from server.web.interface import OF_KEPT, files, raises, takes
from server.web.routes.session_request import OF_VEHICLE, VehicleName, as_json, ask, vehicle_of
from server.web.services import services

router = APIRouter(tags=["marks"], responses=OF_VEHICLE)
kept = APIRouter(tags=["marks"], responses=raises(*OF_KEPT))  # at a web node: answered by the agent of the car
_TAKEN = raises(409, 415, 507)
MarkOfPath = Annotated[str, Field(pattern=MARK), InPath(description="The mark's id")]


@router.get("/api/marks", response_model=MarkList, summary="The marks of this drive, the newest moment last")
async def listed(request: Request, vehicle: VehicleName = None) -> Response:
    return as_json(await ask(request, vehicle, {"kind": "marks"}))


@kept.post(
    "/api/marks/{mark}/voice",
    response_model=DriveMark,
    responses=_TAKEN,
    openapi_extra=takes(*TYPES["voice"]),
    summary="Add a voice note to a mark: audio/webm, audio/ogg or audio/mp4",
)
async def add_voice(request: Request, mark: MarkOfPath, vehicle: VehicleName = None) -> Response:
    """The body is the file itself, of at most 1 MB. The same again changes nothing, another one takes its place."""
    return await _added(request, mark, "voice", vehicle)


@kept.post(
    "/api/marks/{mark}/photo",
    response_model=DriveMark,
    responses=_TAKEN,
    openapi_extra=takes(*TYPES["photo"]),
    summary="Add a photo to a mark: image/jpeg, image/png or image/webp",
)
async def add_photo(request: Request, mark: MarkOfPath, vehicle: VehicleName = None) -> Response:
    """The body is the file itself, of at most 8 MB. The same again changes nothing, another one takes its place."""
    return await _added(request, mark, "photo", vehicle)


@kept.get(
    "/api/marks/{mark}/voice",
    responses=files(*TYPES["voice"]),
    summary="The voice note of a mark",
    response_class=Response,
)
def voice(request: Request, mark: MarkOfPath, vehicle: VehicleName = None) -> Response:
    return _media(request, mark, "voice", vehicle)


@kept.get(
    "/api/marks/{mark}/photo", responses=files(*TYPES["photo"]), summary="The photo of a mark", response_class=Response
)
def photo(request: Request, mark: MarkOfPath, vehicle: VehicleName = None) -> Response:
    return _media(request, mark, "photo", vehicle)


async def _added(request: Request, mark: str, kind: Kind, vehicle: str | None) -> Response:
    app = services(request)
    pending = app.pending_media
    if pending is None:
        raise HTTPException(404, app.where_kept("for voice notes and photos"))
    name = vehicle_of(app, vehicle)
    await ask(request, name, {"kind": "mark_file", "file": None, "mark": mark})  # before it is taken at all
    try:
        file = media.named(mark, kind, request.headers.get("content-type", ""))
        data = await _body(request, kind)
        media.check(file, data)
        await app.storage.run(lambda: pending.keep(name, file, data))
    except BadMedia as why:
        raise HTTPException(415, str(why)) from None
    except NoRoom as why:
        raise HTTPException(507, str(why)) from None
    except OSError as why:
        raise HTTPException(507, f"The disk does not take it: {why.strerror or why}.") from None
    answer = await ask(request, name, {"kind": "mark_file", "file": file.file, "mark": mark})
    await app.storage.run(lambda: None)  # behind the job that writes the log
    return as_json(answer)


async def _body(request: Request, kind: Kind) -> bytes:
    """Raises HTTPException 413 as soon as it is too large."""
    most = media.MAX_BYTES[kind]
    length = request.headers.get("content-length", "")
    data = bytearray()
    if not (length.isdigit() and int(length) > most):
        async for portion in request.stream():
            data += portion
            if len(data) > most:
                break
        else:
            return bytes(data)
    raise HTTPException(413, media.too_large(kind))


def _media(request: Request, mark: str, kind: Kind, vehicle: str | None) -> Response:
    app = services(request)
    name = vehicle_of(app, vehicle)
    found = None if app.pending_media is None else app.pending_media.read(name, mark, kind)
    if found is None:
        stored = None if app.recordings is None else app.recordings.of_mark(name, mark)
        found = next((media_ for path in stored or () if (media_ := _in_recording(path, mark, kind)) is not None), None)
    if found is None:
        raise HTTPException(404, f"This mark has no {kind}.")
    return media_answer(*found)


def _in_recording(path: Path, mark: str, kind: Kind) -> tuple[MediaName, bytes] | None:
    """One recording that cannot be read does not hide the others."""
    with contextlib.suppress(OSError):
        return read_media(path, mark, kind)
    return None


def media_answer(file: MediaName, data: bytes) -> Response:
    """Shown inline: a browser treats it only as its declared type."""
    headers = {
        "Content-Disposition": f'inline; filename="{file.attachment}"',
        "Cache-Control": "private, no-cache",
    }
    return Response(data, media_type=file.media_type, headers=headers)


router.include_router(kept)
