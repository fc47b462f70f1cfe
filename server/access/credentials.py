"""The credentials of a request: the cookie of a paired device, one-shot tickets for the socket, keys of programs."""

from __future__ import annotations

import hashlib
import hmac
import math
import os
import secrets
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from itsdangerous import BadSignature, TimestampSigner

from server.access.identity import Principal, Role

COOKIE_LASTS_S = 90 * 86_400  # as long as a device is remembered; renewed long before
COOKIE_RENEWED_AFTER_S = 86_400
_LONGEST_COOKIE = 400  # letters; ours has about 110

TICKET_LASTS_S = 5.0
TICKET_AFTER_SOCKET_S = 600.0  # after the end of the device's last socket: a page that is away for longer requests one
LEFT_A_SOCKET = 4  # tickets of ended sockets that are kept for each one that is served, beside its own
MOST_TICKETS = 2000

SHORTEST_KEY = 20  # letters: `openssl rand -hex 16` gives 32
_LONGEST_KEY = 512
VARIABLES = {"CATGRAPH_KEY": Role.OPERATOR, "CATGRAPH_VIEWER_KEY": Role.VIEWER}  # each also as …_FILE


class Cookies:
    """Signs and reads cookies of one server."""

    def __init__(self, key: str, server: str, *, wall_ms: Callable[[], int]) -> None:
        """`server`: a short id that distinguishes two servers on one host, because cookies ignore ports."""

        class Signer(TimestampSigner):
            def get_timestamp(self) -> int:
                return wall_ms() // 1000

        self._signer = Signer(key, salt="catgraph device", key_derivation="hmac", digest_method=hashlib.sha256)
        self._server = server
        self._wall_ms = wall_ms

    def name(self, is_secure: bool) -> str:
        """The cookie's name; with TLS it has a prefix that requires Secure, Path=/ and no Domain."""
        return f"{'__Host-' if is_secure else ''}catgraph-{self._server}"

    def header(self, id: str, secret: str, *, is_secure: bool) -> str:
        """The value of Set-Cookie."""
        value = self._signer.sign(f"{id}:{secret}").decode()
        kept = f"Path=/; Max-Age={COOKIE_LASTS_S}; HttpOnly; SameSite=Strict"
        return f"{self.name(is_secure)}={value}; {kept}{'; Secure' if is_secure else ''}"

    def read(self, header: str, *, is_secure: bool) -> tuple[str, str, bool] | None:
        """Id, secret and whether the cookie is due for renewal; None: missing, forged or expired."""
        for part in header.split(";"):
            name, _, value = part.strip().partition("=")
            if name == self.name(is_secure) and len(value) <= _LONGEST_COOKIE:
                return self._unsigned(value)
        return None

    def _unsigned(self, value: str) -> tuple[str, str, bool] | None:
        try:
            token, given = self._signer.unsign(value, max_age=COOKIE_LASTS_S, return_timestamp=True)
            id, _, secret = token.decode().partition(":")
        except (BadSignature, UnicodeDecodeError):
            return None
        return id, secret, self._wall_ms() / 1000 - given.timestamp() > COOKIE_RENEWED_AFTER_S


class Tickets:
    """One-shot tickets for the socket: issued to an authenticated request or socket, used up by the next socket.

    Those not used yet.
    """

    def __init__(self) -> None:
        self._open: OrderedDict[str, tuple[str, float]] = OrderedDict()  # ticket → whose, until when [s]
        self._served: Counter[str] = Counter()  # sockets of each
        self._left: dict[str, deque[str]] = {}  # given with sockets that have ended, while others are served

    def new(self, whose: str, *, now_s: float, lasts_s: float = TICKET_LASTS_S) -> str:
        """A ticket for the device or program `whose`."""
        self._drop(now_s)
        ticket = secrets.token_urlsafe(18)
        self._open[ticket] = (whose, now_s + lasts_s)
        while len(self._open) > MOST_TICKETS:
            self._open.popitem(last=False)
        return ticket

    @contextmanager
    def beside_socket(self, whose: str, *, now: Callable[[], float]) -> Iterator[str]:
        """A ticket for the socket after the one that is served meanwhile.

        While another socket of the device is served, it lasts: a page may have it of a second connection that it did
        not need.
        """
        ticket = self.new(whose, now_s=now(), lasts_s=math.inf)
        self._served[whose] += 1
        try:
            yield ticket
        finally:
            self._served -= Counter((whose,))
            left = self._left.setdefault(whose, deque())
            left.append(ticket)
            while len(left) > LEFT_A_SOCKET * self._served[whose]:
                if (oldest := left.popleft()) in self._open:
                    self._open[oldest] = (whose, now() + TICKET_AFTER_SOCKET_S)
            if not left:
                del self._left[whose]

    def use(self, ticket: str, whose: str, *, now_s: float) -> bool:
        """Whether `whose` may open a socket with it. It is used up by being shown, right or not."""
        self._drop(now_s)
        owner, _ = self._open.pop(ticket, ("", 0.0))
        return bool(owner) and hmac.compare_digest(owner.encode(), whose.encode())

    def _drop(self, now_s: float) -> None:
        for ticket in [one for one, (_, until_s) in self._open.items() if until_s <= now_s]:
            del self._open[ticket]


class BadKey(ValueError):
    """A key that must not be used; `str()` is one sentence without the key."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Keys:
    """The hashes of the keys, so that no error report contains a key."""

    hashes: tuple[tuple[bytes, Role], ...] = ()

    def who(self, authorization: str) -> Principal | None:
        """The program with the key in this header. All keys are compared in constant time."""
        scheme, _, key = authorization.partition(" ")
        if scheme.lower() != "bearer" or len(key) > _LONGEST_KEY:
            return None
        given = _hash(key.strip())
        found = None
        for known, role in self.hashes:
            if hmac.compare_digest(known, given):
                found = role
        return None if found is None else Principal(id=f"key-{found}", name=f"{found} key", role=found, is_program=True)


def keys_of(keys: Mapping[Role, str]) -> Keys:
    """Of keys by role. Raises BadKey."""
    for role, key in keys.items():
        if (
            len(key) < SHORTEST_KEY
            or len(key) > _LONGEST_KEY
            or not key.isascii()
            or not key.isprintable()
            or " " in key
        ):
            raise BadKey(
                f"The {role} key is no good: it takes {SHORTEST_KEY} to {_LONGEST_KEY} letters and digits, as random."
            )
    if len(set(keys.values())) < len(keys):
        raise BadKey("The viewer key and the operator key are the same.")
    return Keys(hashes=tuple((_hash(key), role) for role, key in keys.items()))


def keys_from(environment: Mapping[str, str]) -> Keys:
    """Of the variables in VARIABLES, or of the files that they name with _FILE behind. Raises BadKey."""
    found: dict[Role, str] = {}
    for variable, role in VARIABLES.items():
        if key := environment.get(variable):
            found[role] = key
        elif name := environment.get(f"{variable}_FILE"):
            found[role] = _from_file(Path(name), f"{variable}_FILE")
    return keys_of(found)


def _from_file(path: Path, variable: str) -> str:
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_mode & 0o077:
                raise BadKey(f"The file that {variable} names can be read by others: chmod 600 {path}")
            return file.read(4096).decode("ascii").strip()
    except (OSError, UnicodeDecodeError) as why:
        raise BadKey(
            f"The file that {variable} names cannot be read: {getattr(why, 'strerror', None) or why}."
        ) from None


def _hash(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogatepass")).digest()
