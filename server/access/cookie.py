"""The cookie by which a paired device is known: its id and secret, signed, with the time it was given."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from itsdangerous import BadSignature, TimestampSigner

LASTS_S = 90 * 86_400  # as long as a device is remembered; renewed long before
RENEWED_AFTER_S = 86_400
_LONGEST = 400  # letters; ours has about 110


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
        kept = f"Path=/; Max-Age={LASTS_S}; HttpOnly; SameSite=Strict"
        return f"{self.name(is_secure)}={value}; {kept}{'; Secure' if is_secure else ''}"

    def gone(self, *, is_secure: bool) -> str:
        """The value of Set-Cookie that deletes it."""
        kept = "Path=/; Max-Age=0; HttpOnly; SameSite=Strict"
        return f"{self.name(is_secure)}=; {kept}{'; Secure' if is_secure else ''}"

    def read(self, header: str, *, is_secure: bool) -> tuple[str, str, bool] | None:
        """Id, secret and whether the cookie is due for renewal; None: missing, forged or expired."""
        for part in header.split(";"):
            name, _, value = part.strip().partition("=")
            if name == self.name(is_secure) and len(value) <= _LONGEST:
                return self._unsigned(value)
        return None

    def _unsigned(self, value: str) -> tuple[str, str, bool] | None:
        try:
            token, given = self._signer.unsign(value, max_age=LASTS_S, return_timestamp=True)
            id, _, secret = token.decode().partition(":")
        except (BadSignature, UnicodeDecodeError):
            return None
        return id, secret, self._wall_ms() / 1000 - given.timestamp() > RENEWED_AFTER_S
