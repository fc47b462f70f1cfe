"""A real S3 server (moto's) on a port of its own; it notes the requests, and fails as a test wants it to."""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import urllib3
from moto.backends import get_backend
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

from server.recording.store.address import Login, StoreAddress

BUCKET = "recordings"
_ERROR = '<?xml version="1.0"?><Error><Code>{code}</Code><Message>x</Message></Error>'
Fault = Callable[[str, str], tuple[int, str] | None]  # method, path → status and code; None: as it should


@dataclass
class S3:
    """One server with one bucket."""

    endpoint: str = ""
    requests: list[tuple[str, str]] = field(default_factory=list)  # that were answered with success: method, key
    fault: Fault = lambda method, path: None
    delay_s: Callable[[str, str], float] = lambda method, path: 0.0

    @property
    def address(self) -> StoreAddress:
        return StoreAddress(
            bucket=BUCKET, prefix="fleet", endpoint=self.endpoint, login=Login(key_id="an-id", secret="a-secret")
        )

    def sent(self, pattern: str = "") -> list[str]:
        """The keys of objects that were put, in their order."""
        return [key for method, key in self.requests if method == "PUT" and re.search(pattern, key)]

    def keys(self) -> dict[str, bytes]:
        """All that is in the bucket, by key without the prefix."""
        return {key.removeprefix("fleet/"): one.value for key, one in self._bucket().keys.items()}

    def corrupt(self, key: str) -> None:
        """Another byte in the middle of an object."""
        one = self._bucket().keys[f"fleet/{key}"]
        value = bytearray(one.value)
        value[len(value) // 2] ^= 1
        one.value = bytes(value)

    def remove(self, key: str) -> None:
        self._bucket().keys.pop(f"fleet/{key}")

    def _bucket(self) -> Any:
        return get_backend("s3")["123456789012"]["aws"].buckets[BUCKET]

    def __call__(self, app: Any) -> Callable[..., Iterable[bytes]]:
        """The application with this before it."""

        def answer(environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
            method, path = environ["REQUEST_METHOD"], environ["PATH_INFO"]
            if "Signature" not in environ.get("HTTP_AUTHORIZATION", "") + environ.get("QUERY_STRING", ""):
                start("403 Forbidden", [("Content-Length", "0")])
                return [b""]
            if (fault := self.fault(method, path)) is not None:
                size = int(environ.get("CONTENT_LENGTH") or 0)
                while size > 0 and (taken := environ["wsgi.input"].read(min(size, 1 << 20))):
                    size -= len(taken)
                body = _ERROR.format(code=fault[1]).encode()
                start(f"{fault[0]} X", [("Content-Type", "application/xml"), ("Content-Length", str(len(body)))])
                return [body]
            time.sleep(self.delay_s(method, path))

            def note(status: str, headers: Any, *more: Any) -> Any:
                if status.startswith("2"):
                    self.requests.append((method, path.removeprefix(f"/{BUCKET}/fleet/")))
                return start(status, headers, *more)

            return app(environ, note)  # type: ignore[no-any-return]

        return answer


@contextmanager
def s3_server(port: int = 0) -> Iterator[S3]:
    """Runs until the end of the block, with an empty bucket."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    one = S3()
    get_backend("s3").reset()
    server = make_server("127.0.0.1", port, one(DomainDispatcherApplication(create_backend_app)), threaded=True)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    one.endpoint = f"http://127.0.0.1:{server.server_port}"
    made = urllib3.request("PUT", f"{one.endpoint}/{BUCKET}?Signature=x", headers={"Content-Length": "0"})
    assert made.status == 200, made.data
    one.requests.clear()
    try:
        yield one
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
