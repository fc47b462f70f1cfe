"""Fetches one tile from the configured server of tiles, and from nowhere else. Blocking: for a thread.

How long a tile holds is HTTP caching (RFC 9111), Retry-After is RFC 9110 10.2.3. Without headers tiles are valid for
seven days.
"""

from __future__ import annotations

import re
import ssl
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from functools import partial
from urllib.parse import urlsplit

import urllib3
from urllib3.exceptions import HTTPError, NameResolutionError, SSLError

from server.version import catgraph_version
from server.web.maps.image_type import media_type
from server.web.maps.map_options import MapUpstream

DEFAULT_FRESH_S = 7 * 86_400.0  # without headers: the least that OpenStreetMap's tile policy requires
LONGEST_S = 365 * 86_400.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 5.0, 300.0  # after a failure; each doubles the one before
PAUSE_BOUNDS_S = (1.0, 86_400.0)  # the bounds of a Retry-After
MOST, WITHIN_S = 1200, 600.0  # tiles: two a second on end is what driving with the map open needs at most


def fresh_for_s(headers: Mapping[str, str], wall_s: float) -> float | None:
    """How long an answer holds from now [s]; None: it must not be kept."""
    fields = {name.lower(): value for name, value in headers.items()}
    directives: dict[str, str] = {}
    for part in fields.get("cache-control", "").lower().split(","):
        name, _, value = part.strip().partition("=")
        directives.setdefault(name, value.strip('" '))
    if "no-store" in directives:
        return None
    if "no-cache" in directives:
        return 0.0
    for name in ("s-maxage", "max-age"):  # several phones are served from what is kept
        if name in directives:
            return _bounded((_number(directives[name]) or 0.0) - (_number(fields.get("age", "")) or 0.0))
    if "expires" in fields:
        expires_s, date_s = _date_s(fields["expires"]), _date_s(fields.get("date", ""))
        return 0.0 if expires_s is None else _bounded(expires_s - (wall_s if date_s is None else date_s))
    return DEFAULT_FRESH_S


def retry_after_s(value: str | None, wall_s: float) -> float | None:
    """The requested pause [s], bounded; None: none."""
    if not value:
        return None
    pause_s = _number(value)
    if pause_s is None:
        at_s = _date_s(value)
        pause_s = None if at_s is None else at_s - wall_s
    return None if pause_s is None else min(max(pause_s, PAUSE_BOUNDS_S[0]), PAUSE_BOUNDS_S[1])


class Pace:
    """When the next tile may be requested. Times are monotonic [s]."""

    def __init__(self) -> None:
        self.problem: str | None = None  # what went wrong last; None once it is over
        self._until_s = 0.0
        self._pause_s = FIRST_PAUSE_S
        self._requested_s: deque[float] = deque(maxlen=MOST)

    def may_ask(self, now_s: float) -> bool:
        return now_s >= self._until_s and not self._is_spent(now_s)

    def note_request(self, now_s: float) -> None:
        self._requested_s.append(now_s)

    def well(self) -> None:
        """It answered as it should."""
        self.problem = None
        self._pause_s = FIRST_PAUSE_S

    def failed(self, why: str, now_s: float, wanted_s: float | None = None) -> None:
        """Record a failure; `wanted_s` is the requested pause. Two concurrent failures count once."""
        is_new = now_s >= self._until_s
        self.problem = why
        self._until_s = max(self._until_s, now_s + (self._pause_s if wanted_s is None else wanted_s))
        if is_new:
            self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)

    def problem_now(self, now_s: float) -> str | None:
        """Why no request is allowed now, as one sentence for the operator."""
        if self.problem is not None:
            return self.problem
        if self._is_spent(now_s):
            return f"{MOST} tiles were fetched within {WITHIN_S / 60:.0f} min: more come later."
        return None

    def _is_spent(self, now_s: float) -> bool:
        return len(self._requested_s) == MOST and now_s - self._requested_s[0] < WITHIN_S


def _bounded(seconds: float) -> float:
    return min(max(seconds, 0.0), LONGEST_S)


def _number(text: str) -> float | None:
    return float(text) if re.fullmatch(r"[0-9]{1,12}", text.strip()) else None


def _date_s(text: str) -> float | None:
    try:
        return parsedate_to_datetime(text).timestamp()
    except (ValueError, TypeError, OverflowError, IndexError):
        return None


CONNECTIONS = 2
LARGEST_BYTES = 2 * 2**20  # a tile of 512 pixels at its most colourful
ANSWERS_S, WHOLE_S = 8.0, 20.0  # its first byte, its last
REFUSED_PAUSE_S = 600.0  # a wrong key does not become right by asking
_PIECE = 64 * 1024


class SourceTrouble(Exception):
    """No tile came; `str()` is one sentence. `pause_s`: how long not to ask; None: as after any failure."""

    def __init__(self, why: str, pause_s: float | None = None) -> None:
        super().__init__(why)
        self.pause_s = pause_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """The answer of the tile server."""

    is_same: bool = False  # what is kept still holds
    data: bytes | None = None  # None and not the same: there is no tile
    fresh_s: float | None  # None: must not be kept
    etag: str | None = None
    modified: str | None = None


class TileSource:
    """One host. No redirect is followed, no proxy or password is taken from the environment, no cookie is kept."""

    def __init__(self, upstream: MapUpstream) -> None:
        self.host = upstream.host
        self._template = upstream.template
        parts = urlsplit(upstream.template)
        pool: Callable[..., urllib3.HTTPConnectionPool] = urllib3.HTTPConnectionPool
        if parts.scheme == "https":
            pool = partial(urllib3.HTTPSConnectionPool, ssl_context=ssl.create_default_context())
        self._pool = pool(
            parts.hostname,
            port=parts.port,
            maxsize=CONNECTIONS,
            block=True,
            timeout=urllib3.Timeout(connect=5.0, read=ANSWERS_S),
            retries=False,
            headers={"User-Agent": f"catgraph/{catgraph_version()}", "Accept": "image/webp,image/png,image/jpeg"},
        )

    def close(self) -> None:
        self._pool.close()

    def fetch(
        self, z: int, x: int, y: int, *, wall_s: float, etag: str | None = None, modified: str | None = None
    ) -> Fetched:
        """The tile of column x, row y from the north. Raises SourceTrouble."""
        headers = {"Accept-Encoding": "identity"}
        if etag is not None:
            headers["If-None-Match"] = etag
        if modified is not None:
            headers["If-Modified-Since"] = modified
        try:
            answer = self._pool.request(
                "GET",
                self._path(z, x, y),
                headers={**self._pool.headers, **headers},
                redirect=False,
                preload_content=False,
                decode_content=False,
            )
            try:
                return self._read(answer, wall_s, was_kept=etag is not None or modified is not None)
            finally:
                _leave(answer)
        except NameResolutionError:
            raise SourceTrouble(f"The map's server {self.host} is not found: check the internet connection.") from None
        except SSLError:
            raise SourceTrouble(f"The certificate of the map's server {self.host} is not trusted.") from None
        except (HTTPError, OSError):  # its text holds the address, which may hold a key
            raise SourceTrouble(f"The map's server {self.host} does not answer.") from None

    def _path(self, z: int, x: int, y: int) -> str:
        filled = self._template.replace("{z}", str(z)).replace("{x}", str(x))
        parts = urlsplit(filled.replace("{y}", str(y)).replace("{-y}", str((1 << z) - 1 - y)))
        return f"{parts.path or '/'}{'?' + parts.query if parts.query else ''}"

    def _read(self, answer: urllib3.BaseHTTPResponse, wall_s: float, *, was_kept: bool) -> Fetched:
        fresh_s = fresh_for_s(answer.headers, wall_s)
        match answer.status:
            case 304 if was_kept:
                etag, modified = answer.headers.get("ETag"), answer.headers.get("Last-Modified")
                return Fetched(is_same=True, fresh_s=fresh_s, etag=etag, modified=modified)
            case 204 | 404 | 410:
                return Fetched(fresh_s=fresh_s)
            case 429 | 503:
                pause_s = retry_after_s(answer.headers.get("Retry-After"), wall_s)
                raise SourceTrouble(f"The map's server {self.host} requests a pause.", pause_s)
            case 401 | 403:
                why = f"The map's server {self.host} refuses ({answer.status}): check the key."
                raise SourceTrouble(why, REFUSED_PAUSE_S)
            case 200:
                pass
            case 301 | 302 | 303 | 307 | 308:
                raise SourceTrouble(f"The map's server {self.host} redirects, which is not followed.")
            case status:
                raise SourceTrouble(f"The map's server {self.host} answers with status {status}.")
        data = self._body(answer)
        if media_type(data) is None:
            raise SourceTrouble(f"The map's server {self.host} answers with something that is not an image.")
        etag, modified = answer.headers.get("ETag"), answer.headers.get("Last-Modified")
        return Fetched(data=data, fresh_s=fresh_s, etag=etag, modified=modified)

    def _body(self, answer: urllib3.BaseHTTPResponse) -> bytes:
        until_s = time.monotonic() + WHOLE_S
        pieces = bytearray()
        for piece in answer.stream(_PIECE, decode_content=False):
            pieces += piece
            if len(pieces) > LARGEST_BYTES:
                raise SourceTrouble(f"A tile of the map's server {self.host} is larger than {LARGEST_BYTES >> 20} MB.")
            if time.monotonic() > until_s:
                raise SourceTrouble(f"The map's server {self.host} is too slow.")
        return bytes(pieces)


def _leave(answer: urllib3.BaseHTTPResponse) -> None:
    """The connection is used again where little is left to read, or nothing; else it is closed."""
    left = answer.length_remaining
    if left is not None and left <= _PIECE:
        answer.drain_conn()
        answer.release_conn()
    else:
        answer.close()
