"""The page's files as they go out: compressed once and kept, scripts without their comments.

A phone on an access point loads some sixty small modules; as they are written they are 260 kB, as they go out 70 kB.
What a browser must never do is run yesterday's script: a file asked for with the hash of its content may be kept for
ever, every other one is asked about each time, and answered 304 while it is the same.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from stat import S_ISREG

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_YEAR = "public, max-age=31536000, immutable"
_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".webmanifest": "application/manifest+json",
}
# Whole lines of comment, and blocks that begin and end their lines: a third of our scripts. No more is taken out, for
# what else stands between two quotes, in a pattern or in a text within a text is not for an expression to tell.
_COMMENT = re.compile(rb"^[ \t]*(?://[^\n]*|/\*\*(?:(?!\*/)[\s\S])*\*/)[ \t]*\r?\n", re.MULTILINE)
_IMPORT = re.compile(r"""^\s*(?:import|export)\b[^;'"(]*?(?:from\s+)?['"](\.[^'"]+)['"]""", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """One file as it goes out."""

    plain: bytes
    small: bytes  # gzip
    etag: str


def packed(body: bytes) -> Packed:
    """Any text, compressed as far as gzip can, and without a date, so that the same text is the same bytes."""
    digest = hashlib.sha256(body).hexdigest()[:20]
    return Packed(plain=body, small=gzip.compress(body, 9, mtime=0), etag=digest)


def answer(file: Packed, headers: Headers, media_type: str, keep: str) -> Response:
    """The whole, or 304 where the browser has it."""
    is_small = "gzip" in headers.get("accept-encoding", "")
    etag = f'"{file.etag}{"-gz" if is_small else ""}"'
    told = {"ETag": etag, "Cache-Control": keep, "Vary": "Accept-Encoding"}
    if etag in headers.get("if-none-match", ""):
        return Response(status_code=304, headers=told)
    if is_small:
        return Response(file.small, media_type=media_type, headers=told | {"Content-Encoding": "gzip"})
    return Response(file.plain, media_type=media_type, headers=told)


class StaticText(StaticFiles):
    """Static files; texts among them small."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        keep = _YEAR if scope.get("query_string", b"").startswith(b"v=") else "no-cache"
        media_type = _TYPES.get(os.path.splitext(path)[1])
        if media_type is not None and scope["method"] == "GET":
            full, stat = self.lookup_path(path)
            if stat is not None and S_ISREG(stat.st_mode):
                return answer(_read(Path(full), stat.st_mtime_ns), Headers(scope=scope), media_type, keep)
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = keep
        return response


@lru_cache(maxsize=512)
def _read(path: Path, changed_ns: int) -> Packed:
    body = path.read_bytes()
    is_ours = path.suffix == ".js" and "vendor" not in path.parts  # others' licences stand in their first lines
    return packed(_COMMENT.sub(b"", body) if is_ours else body)


def modules_of(script: Path) -> list[str]:
    """The names of all modules beside `script` that it imports, and they import, without what is imported later.

    The page names them in its head, so that a browser asks for all at once instead of one depth after another.
    """
    found: dict[str, None] = {}
    waiting = [script]
    while waiting:
        module = waiting.pop(0)
        for name in _IMPORT.findall(module.read_text("utf-8")):
            path = (module.parent / name).resolve()
            key = path.relative_to(script.parent.resolve()).as_posix() if path.is_file() else ""
            if key and key not in found and path != script:
                found[key] = None
                waiting.append(path)
    return list(found)
