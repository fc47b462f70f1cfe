"""Keys of programs, sent as `Authorization: Bearer KEY`: from the environment, or from files of mode 0600."""

from __future__ import annotations

import hashlib
import hmac
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from server.access.identity import Principal, Role

SHORTEST = 20  # letters: `openssl rand -hex 16` gives 32
_LONGEST = 512
VARIABLES = {"CATGRAPH_KEY": Role.OPERATOR, "CATGRAPH_VIEWER_KEY": Role.VIEWER}  # each also as …_FILE


class BadKey(ValueError):
    """A key that must not be used; `str()` is one sentence without the key."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Keys:
    """The hashes of the keys, so that no error report contains a key."""

    hashes: tuple[tuple[bytes, Role], ...] = ()

    def who(self, authorization: str) -> Principal | None:
        """The program with the key in this header. All keys are compared in constant time."""
        scheme, _, key = authorization.partition(" ")
        if scheme.lower() != "bearer" or len(key) > _LONGEST:
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
        if len(key) < SHORTEST or len(key) > _LONGEST or not key.isascii() or not key.isprintable() or " " in key:
            raise BadKey(f"The {role} key is no good: it takes {SHORTEST} to {_LONGEST} letters and digits, as random.")
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
