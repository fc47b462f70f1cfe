"""Large files over HTTP: whole or a part of them (RFC 9110, 13 and 14), under a name that no browser stumbles over."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterator
from email.utils import formatdate
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

from fastapi import HTTPException, Request
from fastapi.responses import Response, StreamingResponse

from server.web.middleware.methods import is_head

_PORTION = 256 * 1024  # bytes per step, read in a thread, so that a slow disk blocks nobody
_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})", re.ASCII)
_SEVERAL = re.compile(r"bytes=[^,]+,", re.ASCII)
_FORBIDDEN = frozenset('/\\:*?"<>|%')  # in names of files, somewhere; % because some programs decode it
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)  # in Windows
MAX_NAME = 120


def file_answer(request: Request, path: Path, *, name: str, media_type: str) -> Response:
    """The file at `path` to be saved as `name`: 200, 206, 304, 416. Call it off the event loop (a `def` route).

    A broken download can resume: the ETag is of size and modification time, so that a replaced file is sent from its
    start. Raises HTTPException: 404 if the file is missing.
    """
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise HTTPException(404, "The file no longer exists.") from None
    except OSError as why:
        raise HTTPException(503, f"The file cannot be read: {why.strerror or why}.") from None
    try:
        status, first, last, sent_headers = _requested_range(request, os.fstat(file.fileno()))
    except BaseException:
        file.close()
        raise
    sent_headers["Content-Disposition"] = disposition(name)
    if is_head(request) or status == 304:
        file.close()
        if status == 304:
            del sent_headers["Content-Length"]
        return Response(status_code=status, headers=sent_headers, media_type=media_type)
    return StreamingResponse(
        _portions(file, first, last), status_code=status, headers=sent_headers, media_type=media_type
    )


def _requested_range(request: Request, stat: os.stat_result) -> tuple[int, int, int, dict[str, str]]:
    """Status, first byte, last byte and headers of the answer."""
    size = stat.st_size
    etag, changed = f'"{size:x}-{stat.st_mtime_ns:x}"', formatdate(stat.st_mtime, usegmt=True)
    sent_headers = {
        "ETag": etag,
        "Last-Modified": changed,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, no-cache",
        "Content-Length": str(size),
    }
    if _names(request.headers.get("if-none-match", ""), etag):
        return 304, 0, -1, sent_headers
    requested = request.headers.get("range")
    condition = request.headers.get("if-range")
    if requested is None or is_head(request) or (condition is not None and condition not in (etag, changed)):
        return 200, 0, size - 1, sent_headers
    if _SEVERAL.match(requested):
        raise HTTPException(
            416, "Several ranges at once are not supported: request one.", headers={"Content-Range": f"bytes */{size}"}
        )
    part = _RANGE.fullmatch(requested.replace(" ", ""))
    if part is None or part.group(1) == part.group(2) == "":
        return 200, 0, size - 1, sent_headers  # another unit, or no range at all: as if it were not there
    begin, end = part.groups()
    first = int(begin) if begin else max(0, size - int(end))
    last = min(int(end), size - 1) if begin and end else size - 1
    if begin and end and int(end) < int(begin):
        return 200, 0, size - 1, sent_headers  # no range either
    if first >= size or (not begin and int(end) == 0):
        raise HTTPException(
            416,
            f"The file ends at byte {size}.",
            headers={"Content-Range": f"bytes */{size}", "Accept-Ranges": "bytes"},
        )
    sent_headers |= {"Content-Range": f"bytes {first}-{last}/{size}", "Content-Length": str(last - first + 1)}
    return 206, first, last, sent_headers


def _names(condition: str, etag: str) -> bool:
    tags = [tag.strip().removeprefix("W/") for tag in condition.split(",")]
    return etag in tags or "*" in tags


def _portions(file: BinaryIO, first: int, last: int) -> Iterator[bytes]:
    with file:
        file.seek(first)
        left = last - first + 1
        while left > 0 and (portion := file.read(min(_PORTION, left))):
            left -= len(portion)
            yield portion


def disposition(name: str) -> str:
    """Content-Disposition that saves under `name`, whatever letters it has (RFC 6266)."""
    kept = file_name(name)
    plain = "".join(letter if " " <= letter <= "~" and letter not in '"\\' else "_" for letter in kept)
    if plain == kept:
        return f'attachment; filename="{plain}"'
    return f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(kept, safe='')}"


def file_name(name: str) -> str:
    """`name` as any system takes it for a file: no folders, no signs that are not seen, at most 120 letters."""
    stem, dot, ending = name.rpartition(".")
    if not dot or not re.fullmatch(r"[A-Za-z0-9]{1,10}", ending):
        stem, dot, ending = name, "", ""
    stem = " ".join("".join(_letter(letter) for letter in stem[: 8 * MAX_NAME]).split())
    stem = stem[: MAX_NAME - len(dot) - len(ending)].strip(" .") or "recording"
    return f"{'_' if _RESERVED.match(stem) else ''}{stem}{dot}{ending}"


def _letter(letter: str) -> str:
    if letter in _FORBIDDEN:
        return "_"
    return " " if unicodedata.category(letter)[0] in "CZ" else letter
