"""One bucket: objects are sent, read, listed and deleted. Blocking: for a thread.

obstore signs the requests and reads. What is large is sent by urllib3 to an address that obstore signed: obstore sends
an object at once at the speed of the link, which on a car's uplink delays what is live.
"""

from __future__ import annotations

import hashlib
import re
import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, BinaryIO, TypeVar

import obstore
import urllib3
from obstore.exceptions import BaseError
from obstore.store import S3Store
from urllib3.exceptions import HTTPError, SSLError

from server.recording.store.address import StoreAddress
from server.recording.store.trouble import Kind, StoreTrouble, code_of, of_answer, unreachable, untrusted

_STEP_S = 0.2  # between two checks whether the transfer may continue

PORTION = 64 * 1024  # sent at once
READ_PORTION = 2**20  # a request
CONNECTS_S, ANSWERS_S = 10.0, 60.0
_SIGNED_FOR = timedelta(hours=12)  # a part at the slowest rate
_STATUS = re.compile(r"status(?: code)?: (\d{3})")
T = TypeVar("T")


class Pace:
    """Limits a transfer to a number of bytes a second, and ends it when it must end.

    `may_go_on` is called before each portion and raises where the transfer must end.
    """

    def __init__(
        self,
        bytes_per_s: Callable[[], float],
        may_go_on: Callable[[], None],
        *,
        now: Callable[[], float],
        sleep: Callable[[float], object],
    ) -> None:
        self._bytes_per_s = bytes_per_s
        self._may_go_on = may_go_on
        self._now = now
        self._sleep = sleep
        self._due_s = 0.0

    def check(self) -> None:
        """Raises where the transfer must end."""
        self._may_go_on()

    def take(self, count: int) -> None:
        """Return when that number of further bytes may be sent or received."""
        self._may_go_on()
        rate = self._bytes_per_s()
        if rate <= 0:
            return
        self._due_s = max(self._due_s, self._now()) + count / rate
        while (left_s := self._due_s - self._now()) > 0:
            self._sleep(min(left_s, _STEP_S))
            self._may_go_on()


class FileChanged(Exception):
    """The file is shorter than it was, or cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """An object of a list."""

    key: str
    size: int
    version: str  # another one: another content


class ObjectStore:
    """Its methods may be called from any thread and raise StoreTrouble."""

    def __init__(self, address: StoreAddress) -> None:
        self.address = address
        tls = ssl.create_default_context()
        options: dict[str, Any] = {"timeout": f"{ANSWERS_S:.0f}s", "connect_timeout": f"{CONNECTS_S:.0f}s"}
        if address.authority is not None:
            tls.load_verify_locations(cafile=address.authority)
            options["root_certificate"] = address.authority.read_bytes()
        config: dict[str, Any] = {"prefix": address.prefix or None, "region": address.region}
        if address.endpoint is not None:
            config["endpoint"] = address.endpoint
            options["allow_http"] = address.endpoint.startswith("http:")
        if address.login.token is not None:
            config["session_token"] = address.login.token
        self._bucket = S3Store(
            address.bucket,
            access_key_id=address.login.key_id,
            secret_access_key=address.login.secret,
            virtual_hosted_style_request=address.endpoint is None,
            client_options=options,  # type: ignore[arg-type]
            retry_config={"max_retries": 0},  # the uploader retries, and shows that
            **config,
        )
        self._pool = urllib3.PoolManager(
            num_pools=2, retries=False, ssl_context=tls, timeout=urllib3.Timeout(connect=CONNECTS_S, read=ANSWERS_S)
        )

    def put(self, key: str, body: bytes) -> None:
        """A small object, whole or not at all."""
        self._ask(lambda: obstore.put(self._bucket, key, body, use_multipart=False))

    def send(self, key: str, file: BinaryIO, size: int, pace: Pace) -> str:
        """The next `size` bytes of a file as an object, at the pace given; the SHA-256 of what was sent.

        What the pace raises ends it, and the store has nothing of it then. Raises FileChanged too.
        """
        digest = hashlib.sha256()
        address = self._ask(lambda: obstore.sign(self._bucket, "PUT", key, _SIGNED_FOR))
        try:
            answer = self._pool.request(
                "PUT", address, body=_portions(file, size, pace, digest.update), headers={"Content-Length": str(size)}
            )
        except SSLError:
            raise untrusted(self.address.host) from None
        except (HTTPError, OSError):  # its text holds the address with the signature
            raise unreachable(self.address.host) from None
        if answer.status != 200:
            raise self._refused(answer.status, code_of(answer.data[:4000].decode("utf-8", "replace")))
        return digest.hexdigest()

    def read(self, key: str, size: int, pace: Pace | None = None) -> Iterator[bytes]:
        """The content of an object of `size` bytes."""
        for start in range(0, size, READ_PORTION):
            length = min(READ_PORTION, size - start)
            if pace is not None:
                pace.take(length)
            yield self._range(key, start, length)

    def _range(self, key: str, start: int, length: int) -> bytes:
        return bytes(self._ask(lambda: obstore.get_range(self._bucket, key, start=start, length=length)))

    def size(self, key: str) -> int:
        """Bytes of an object."""
        return int(self._ask(lambda: obstore.head(self._bucket, key))["size"])

    def get(self, key: str, *, most: int) -> bytes:
        """A small object, whole; one that is larger than `most` is refused."""
        size = self.size(key)
        if size > most:
            raise StoreTrouble(Kind.OTHER, "An object of the store is larger than it may be.")
        return b"" if size == 0 else self._range(key, 0, size)

    def list(self, prefix: str) -> Iterator[Found]:
        """The objects below a folder, in the order of their names."""
        stream = iter(obstore.list(self._bucket, prefix=prefix.rstrip("/")))
        while (batch := self._ask(lambda: next(stream, None))) is not None:
            for one in batch:
                yield Found(key=one["path"], size=one["size"], version=one["e_tag"] or str(one["last_modified"]))

    def delete(self, key: str) -> None:
        self._ask(lambda: obstore.delete(self._bucket, key))

    def _ask(self, request: Callable[[], T]) -> T:
        try:
            return request()
        except (BaseError, OSError, ValueError) as why:
            raise self._trouble(why) from None

    def _trouble(self, why: Exception) -> StoreTrouble:
        text = str(why)[:4000]
        status = _STATUS.search(text)
        if status is not None:
            return self._refused(int(status[1]), code_of(text))
        if "certificate" in text.lower():
            return untrusted(self.address.host)
        if isinstance(why, FileNotFoundError):
            return self._refused(404, code_of(text))
        return unreachable(self.address.host)

    def _refused(self, status: int, code: str) -> StoreTrouble:
        return of_answer(status, code, host=self.address.host, bucket=self.address.bucket)


def _portions(file: BinaryIO, size: int, pace: Pace, note: Callable[[bytes], None]) -> Iterator[bytes]:
    left = size
    while left:
        try:
            portion = file.read(min(PORTION, left))
        except OSError as why:
            raise FileChanged(f"The file cannot be read: {why.strerror or why}.") from None
        if not portion:
            raise FileChanged("The file became shorter while it was sent.")
        note(portion)
        left -= len(portion)
        pace.take(len(portion))
        yield portion
