"""Where the store is and by which login: a bucket of an S3-compatible service. The login is never part of a command."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from server.storage import bounded_toml

_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]")
_PREFIX = re.compile(r"[A-Za-z0-9._-]+(/[A-Za-z0-9._-]+)*")
_REGION = re.compile(r"[a-z0-9-]{1,40}")
_MAX_FILE = 16 * 1024
_ENDPOINT = "The endpoint of the store must look like https://store.example:9000."
USUAL_REGION = "us-east-1"


class BadStore(ValueError):
    """An address or login that cannot be used; `str()` is one sentence without the login."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Login:
    """What the requests are signed with."""

    key_id: str
    secret: str = field(repr=False)
    token: str | None = field(default=None, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreAddress:
    """A bucket, and the folder in it below which everything of ours is."""

    bucket: str
    prefix: str = ""
    endpoint: str | None = None  # None: Amazon's own
    region: str = USUAL_REGION
    authority: Path | None = None  # PEM; trusted beside those of the system
    login: Login = field(repr=False)

    @property
    def text(self) -> str:
        """As a person reads it."""
        return f"s3://{self.bucket}{'/' if self.prefix else ''}{self.prefix}"

    @property
    def host(self) -> str:
        """Who is spoken to."""
        return urlsplit(self.endpoint).netloc if self.endpoint else "Amazon S3"


def store_address(
    text: str,
    *,
    endpoint: str | None = None,
    region: str | None = None,
    key_file: Path | None = None,
    authority: Path | None = None,
    environment: Mapping[str, str],
) -> StoreAddress:
    """What `s3://bucket/prefix` and the options say; the rest is in the variables that every S3 client reads.

    Raises BadStore.
    """
    bucket, _, prefix = text.removeprefix("s3://").partition("/")
    prefix = prefix.strip("/")
    if not text.startswith("s3://") or not _BUCKET.fullmatch(bucket) or (prefix and not _is_prefix(prefix)):
        raise BadStore(f"“{text[:80]}” is no address of a store: use s3://BUCKET or s3://BUCKET/FOLDER.")
    endpoint = endpoint or environment.get("AWS_ENDPOINT_URL_S3") or environment.get("AWS_ENDPOINT_URL") or None
    region = region or environment.get("AWS_REGION") or environment.get("AWS_DEFAULT_REGION") or USUAL_REGION
    if not _REGION.fullmatch(region):
        raise BadStore("The region of the store is a name such as eu-central-1.")
    return StoreAddress(
        bucket=bucket,
        prefix=prefix,
        endpoint=None if endpoint is None else _endpoint(endpoint),
        region=region,
        authority=authority,
        login=_login_of_file(key_file) if key_file is not None else _login_of_environment(environment),
    )


def _is_prefix(text: str) -> bool:
    return len(text) <= 200 and _PREFIX.fullmatch(text) is not None and not {".", ".."} & set(text.split("/"))


def _endpoint(text: str) -> str:
    try:
        parts = urlsplit(text)
        is_good = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        raise BadStore(_ENDPOINT) from None
    if not is_good or parts.username is not None or parts.path.strip("/") or parts.query or parts.fragment:
        raise BadStore(_ENDPOINT)
    return f"{parts.scheme}://{parts.netloc}"


def _login_of_environment(environment: Mapping[str, str]) -> Login:
    key_id, secret = environment.get("AWS_ACCESS_KEY_ID"), environment.get("AWS_SECRET_ACCESS_KEY")
    if not key_id or not secret:
        raise BadStore(
            "The store needs a login: --store-key FILE, "
            "or AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment."
        )
    return Login(key_id=key_id, secret=secret, token=environment.get("AWS_SESSION_TOKEN") or None)


def _login_of_file(path: Path) -> Login:
    try:
        with open(path, "rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            raw = file.read(_MAX_FILE)
    except OSError as why:
        raise BadStore(f"The login of the store cannot be read from {path}: {why.strerror or why}.") from None
    if mode & 0o077:
        raise BadStore(f"Others may read the login of the store: chmod 600 {path}")
    try:
        body = bounded_toml.loads(raw)
    except ValueError:
        body = {}
    key_id, secret, token = (body.get(name) for name in ("access_key_id", "secret_access_key", "session_token"))
    if not isinstance(key_id, str) or not isinstance(secret, str) or not key_id or not secret:
        raise BadStore(f'{path} needs two lines: access_key_id = "…" and secret_access_key = "…".')
    return Login(key_id=key_id, secret=secret, token=token if isinstance(token, str) and token else None)
