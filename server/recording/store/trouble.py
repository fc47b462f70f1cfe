"""The faults of a store, as sentences."""

from __future__ import annotations

import re
from enum import StrEnum


class Kind(StrEnum):
    UNREACHABLE = "unreachable"
    FORBIDDEN = "forbidden"
    NO_BUCKET = "no_bucket"
    FULL = "full"
    BUSY = "busy"
    MISSING = "missing"  # one object
    OTHER = "other"


class StoreTrouble(Exception):
    """A request failed; `str()` is one sentence that names neither login nor signature."""

    def __init__(self, kind: Kind, sentence: str) -> None:
        super().__init__(sentence)
        self.kind = kind

    @property
    def is_general(self) -> bool:
        """Whether the next file would meet it too."""
        return self.kind not in (Kind.MISSING, Kind.OTHER)


_FULL = frozenset(
    "QuotaExceeded InsufficientCapacity XMinioStorageFull StorageFull TooManyObjects InsufficientStorage "
    "XMinioAdminBucketQuotaExceeded ServiceQuotaExceededException".split()
)
_CODE = re.compile(r"<Code>\s*([A-Za-z]{1,60})\s*</Code>")


def code_of(text: str) -> str:
    """The store's own name of an error, in the text of its answer; empty: it has none."""
    found = _CODE.search(text)
    return found[1] if found is not None else ""


def of_answer(status: int, code: str, *, host: str, bucket: str) -> StoreTrouble:
    """Of an answer that is no success."""
    if status == 507 or code in _FULL:
        return StoreTrouble(Kind.FULL, f"The store {host} is full.")
    if code == "RequestTimeTooSkewed":
        return StoreTrouble(Kind.FORBIDDEN, f"The store {host} refuses the time of this machine: set its clock.")
    if status in (401, 403):
        return StoreTrouble(Kind.FORBIDDEN, f"The store {host} refuses the login ({code or status}).")
    if code == "NoSuchBucket":
        return StoreTrouble(Kind.NO_BUCKET, f"The store {host} has no bucket {bucket}.")
    if status == 404:
        return StoreTrouble(Kind.MISSING, "The store does not have the object.")
    if status in (429, 503):
        return StoreTrouble(Kind.BUSY, f"The store {host} requests a pause ({status}).")
    if status in (301, 307, 400) and code in ("PermanentRedirect", "TemporaryRedirect", "AuthorizationHeaderMalformed"):
        return StoreTrouble(Kind.OTHER, f"The bucket {bucket} is in another region: set --store-region.")
    return StoreTrouble(Kind.OTHER, f"The store {host} answers with status {status}{f' ({code})' if code else ''}.")


def unreachable(host: str) -> StoreTrouble:
    return StoreTrouble(Kind.UNREACHABLE, f"The store {host} does not answer.")


def untrusted(host: str) -> StoreTrouble:
    return StoreTrouble(Kind.UNREACHABLE, f"The certificate of the store {host} is not trusted.")
