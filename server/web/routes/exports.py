"""Exports and clips over HTTP: start, progress, cancel, download."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Body, HTTPException, Request, Response
from fastapi import Path as InPath
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, WithJsonSchema

from server.protocol.answers import ExportJob
from server.protocol.http_answers import CancelledExport, ExportList
from server.recording.export.clip import AFTER_S, BEFORE_S, LONGEST_S, Window
from server.recording.export.formats import FORMATS
from server.recording.export.jobs import Exports, Job, NoSuchRecording, NotYet, TooMany
from server.web.interface import OF_KEPT, files, raises
from server.web.middleware.errors import Problem
from server.web.middleware.ranges import file_answer
from server.web.services import services

router = APIRouter(tags=["recordings"], responses=raises(*OF_KEPT))
_FILES = raises(409) | files(*{form.media_type: None for form in FORMATS.values()}, in_parts=True)
Id = Annotated[str, InPath(max_length=100, description="The recording's `id` in the list")]
JobId = Annotated[str, InPath(max_length=40, description="`job` of the answer that began it")]


def _known(name: str) -> str:
    if name not in FORMATS:
        raise ValueError(f"there is no format {name[:40]!r}")
    return name


Format = Annotated[str, AfterValidator(_known), WithJsonSchema({"type": "string", "enum": [*FORMATS]})]


class ExportRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")
    format: Format = Field(description="; ".join(f"{form.name}: {form.label}, {form.use}" for form in FORMATS.values()))


class ClipRequest(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    at_ms: float = Field(ge=0, le=2**53, description="The moment it is about, ms since 1970: an alarm's `raised_ms`")
    before_s: float = Field(BEFORE_S, ge=0, le=LONGEST_S)
    after_s: float = Field(AFTER_S, ge=0, le=LONGEST_S)


def exports(request: Request) -> Exports:
    found: Exports | None = services(request).exports
    if found is None:
        raise HTTPException(404, services(request).where_kept())
    return found


@router.post("/api/recordings/{id}/exports", status_code=202, summary="Begin an export")
async def begin(request: Request, id: Id, body: Annotated[ExportRequest, Body()]) -> ExportJob:
    """Answers at once; the same export that is going on or still there is answered instead of another."""
    return (await _begun(request, id, body.format)).as_json()


@router.post("/api/recordings/{id}/clip", status_code=202, summary="Cut out the time around a moment, as a recording")
async def clip(request: Request, id: Id, body: Annotated[ClipRequest, Body()]) -> ExportJob:
    """A recording that is going on may be cut too; what is not recorded yet is waited for, at most a minute. The job
    that is done names the new recording."""
    window = Window(at_ns=round(body.at_ms * 1_000_000), before_s=body.before_s, after_s=body.after_s)
    try:
        return (await exports(request).clip(id, window)).as_json()
    except NoSuchRecording as why:
        raise HTTPException(404, str(why)) from None
    except NotYet as why:
        raise Problem(422, str(why), field="at_ms") from None
    except TooMany as why:
        raise HTTPException(429, str(why), headers={"Retry-After": "30"}) from None


@router.get(
    "/api/recordings/{id}/export/{format}",
    responses=_FILES,
    summary="A recording in another format",
    response_class=Response,
)
async def exported(request: Request, id: Id, format: Format) -> Response:
    """Made first where it is not there, which may take a minute for an hour of driving: where a person waits, begin it
    as a job and show how far it is."""
    return await _file(request, await _done(await _begun(request, id, format)))


@router.get(
    "/api/recordings/{id}/report",
    responses=raises(409) | files("text/html", in_parts=True),
    summary="The drive's report, to be looked at",
    response_class=Response,
)
async def report(request: Request, id: Id) -> Response:
    """The export `html`, opened by a browser and not saved; made first where it is not there."""
    answer = await _file(request, await _done(await _begun(request, id, "html")))
    answer.headers["Content-Disposition"] = answer.headers["Content-Disposition"].replace("attachment", "inline", 1)
    return answer


@router.get("/api/exports", summary="The exports that wait, run, or can be downloaded")
async def listed(request: Request) -> ExportList:
    return {"exports": [job.as_json() for job in exports(request).jobs()]}


@router.get("/api/exports/{job}", summary="How far an export is")
async def followed(request: Request, job: JobId) -> ExportJob:
    return _found(request, job).as_json()


@router.delete("/api/exports/{job}", summary="Cancel an export, or remove its file")
async def cancelled(request: Request, job: JobId) -> CancelledExport:
    found = _found(request, job)
    await exports(request).cancel(job)
    return {"ok": True, "state": found.state}


@router.get(
    "/api/exports/{job}/file",
    responses=_FILES,
    summary="The file of an export that is done, whole or in part",
    response_class=Response,
)
async def fetched(request: Request, job: JobId) -> Response:
    return await _file(request, _found(request, job))


async def _begun(request: Request, id: str, format: str) -> Job:
    try:
        return await exports(request).begin(id, format)
    except NoSuchRecording as why:
        raise HTTPException(404, str(why)) from None
    except TooMany as why:
        raise HTTPException(429, str(why), headers={"Retry-After": "30"}) from None


async def _done(job: Job) -> Job:
    await job.finished.wait()
    return job


def _found(request: Request, id: str) -> Job:
    job = exports(request).job(id)
    if job is None:
        raise HTTPException(404, "There is no such export; exports are kept for an hour.")
    return job


async def _file(request: Request, job: Job) -> Response:
    if not job.is_over:
        raise Problem(409, "It is not ready yet.", **job.as_json())
    if job.path is None:
        raise HTTPException(422 if job.state == "failed" else 409, job.sentence)
    return await asyncio.to_thread(_answer, request, job, job.path)


def _answer(request: Request, job: Job, path: Path) -> Response:
    """Named after the recording as the list has it."""
    form, recordings = FORMATS[job.format], services(request).recordings
    row = recordings.row(job.of) if recordings is not None else None
    name = f"{job.of} {row['title'] if row is not None else ''}".strip()
    answer = file_answer(request, path, name=f"{name}.{form.extension}", media_type=form.media_type)
    if job.is_whole is False:
        answer.headers["Catgraph-Not-Whole"] = str(len(job.notes))  # its notes are in the job
    return answer
