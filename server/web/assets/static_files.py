"""The page's files as served: compressed once and cached.

A browser must never run an outdated script: a file with a hash in its address may be cached forever, every other one is
revalidated each time, with 304 while it is unchanged.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from stat import S_ISREG

import deflate
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from server.web.assets.bundle import FOLDER

_LONGEST_NAME = 120
_HASH_LEAST = 12  # digits of a hash in an address
_YEAR = "public, max-age=31536000, immutable"
_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".webmanifest": "application/manifest+json",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """One file as served."""

    plain: bytes
    small: bytes  # gzip
    etag: str


@lru_cache(maxsize=32)
def packed(body: bytes) -> Packed:
    """Any text, compressed as far as gzip can, and without a date, so that the same text is the same bytes."""
    digest = hashlib.sha256(body).hexdigest()[:20]
    return Packed(plain=body, small=bytes(deflate.gzip_compress(body, 12)), etag=digest)


def answer(file: Packed, headers: Headers, media_type: str, keep: str) -> Response:
    """The whole, or 304 where the browser has it."""
    is_small = "gzip" in headers.get("accept-encoding", "")
    etag = f'"{file.etag}{"-gz" if is_small else ""}"'
    sent_headers = {"ETag": etag, "Cache-Control": keep, "Vary": "Accept-Encoding"}
    if etag in headers.get("if-none-match", ""):
        return Response(status_code=304, headers=sent_headers)
    if is_small:
        return Response(file.small, media_type=media_type, headers=sent_headers | {"Content-Encoding": "gzip"})
    return Response(file.plain, media_type=media_type, headers=sent_headers)


class StaticText(StaticFiles):
    """Static files; texts among them small."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        media_type = _TYPES.get(os.path.splitext(path)[1])
        if "\0" in path or any(len(part) > _LONGEST_NAME for part in path.split(os.sep)):
            raise HTTPException(404)  # no file is called so, and asking for it is an error of its own kind
        if media_type is not None and scope["method"] == "GET":
            text = await run_in_threadpool(self._text, path)
            if text is not None:
                is_kept = _is_named(path, scope, text.etag)
                return answer(text, Headers(scope=scope), media_type, _YEAR if is_kept else "no-cache")
        is_kept = _is_named(path, scope, await run_in_threadpool(self._hash, path))
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = _YEAR if is_kept else "no-cache"
        if is_kept and "if-range" not in Headers(scope=scope):  # never revalidated; such a condition is judged by them
            del response.headers["ETag"], response.headers["Last-Modified"]
        return response

    def _text(self, path: str) -> Packed | None:
        full, stat = self.lookup_path(path)
        return _read(Path(full), stat.st_mtime_ns) if stat is not None and S_ISREG(stat.st_mode) else None

    def _hash(self, path: str) -> str:
        full, stat = self.lookup_path(path)
        return hash_of(Path(full), stat.st_mtime_ns) if stat is not None and S_ISREG(stat.st_mode) else ""


def _is_named(path: str, scope: Scope, digest: str) -> bool:
    """Whether the address has the hash of what is there: that of another build names another content."""
    version = bytes(scope.get("query_string", b"")).removeprefix(b"v=").decode("latin-1")
    return path.startswith(f"{FOLDER}/") or (len(version) >= _HASH_LEAST and digest.startswith(version))


@lru_cache(maxsize=512)
def hash_of(path: Path, changed_ns: int) -> str:
    """Of a file's content; `changed_ns` makes a changed file another one for the cache."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@lru_cache(maxsize=512)
def _read(path: Path, changed_ns: int) -> Packed:
    return packed(path.read_bytes())
