"""Who may use the broker: agents and web nodes, each with an NKEY of its own and the subjects it needs, and no more.

`fleet.toml` is the list; `fleet.conf` is made of it and included by the broker's configuration. The secret half of a
key is shown once, when the user is added, and is kept by nobody but the car or the node.

The format of `fleet.conf`: https://docs.nats.io/running-a-nats-service/configuration/securing_nats/auth_intro/nkey_auth
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import nkeys
import orjson
import tomli_w

from server.bus import nats_wire as wire
from server.storage import bounded_toml, durable_file

LIST, CONF = "fleet.toml", "fleet.conf"
KEY_WITHIN_S = 5  # after a connection; by itself a broker waits 2 s, too short for a bad radio that loses a packet
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
_PUBLIC = re.compile(r"U[A-Z2-7]{55}")

# What a node may do with the bucket of paired devices, of the API of JetStream:
# https://docs.nats.io/reference/reference-protocols/nats_api_reference
_BUCKET = "catgraph_devices"
_STREAM = f"KV_{_BUCKET}"
_DEVICES = (
    f"$KV.{_BUCKET}.>",
    f"$JS.API.STREAM.CREATE.{_STREAM}",
    f"$JS.API.STREAM.INFO.{_STREAM}",
    f"$JS.API.STREAM.MSG.GET.{_STREAM}",
    f"$JS.API.DIRECT.GET.{_STREAM}.>",
    f"$JS.API.CONSUMER.CREATE.{_STREAM}",
    f"$JS.API.CONSUMER.CREATE.{_STREAM}.>",
    f"$JS.API.CONSUMER.INFO.{_STREAM}.*",
    f"$JS.API.CONSUMER.DELETE.{_STREAM}.*",
    f"$JS.ACK.{_STREAM}.>",
    "$JS.FC.>",
)

Kind = Literal["agent", "web"]


class FleetRefused(ValueError):
    """The list cannot be read, written or changed so; `str()` is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """An agent, called as its vehicle, or a web node; `key` is the public half of its NKEY."""

    name: str
    kind: Kind
    key: str
    added: str  # the day, as YYYY-MM-DD


def read(folder: Path) -> list[User]:
    """Those in the list of this folder, by name; none where there is no list. Raises FleetRefused."""
    path = folder / LIST
    try:
        users = bounded_toml.loads(path.read_bytes()).get("user", [])  # within its bounds, some 400
        found = [_checked(User(**user)) for user in users]
    except FileNotFoundError:
        return []
    except OSError as why:
        raise FleetRefused(f"{path} cannot be read: {why.strerror}.") from None
    except (ValueError, TypeError, AttributeError) as why:
        raise FleetRefused(f"{path} is not a list of the fleet: {why}") from None
    return sorted(found, key=lambda user: user.name)


def add(folder: Path, name: str, kind: Kind, *, today: str) -> tuple[User, str]:
    """The new user and the secret half of its key. Raises FleetRefused, also where the name is taken."""
    users = read(folder)
    if any(user.name == name for user in users):
        raise FleetRefused(f"{name} is in the list already: remove it first, and its old key is good for nothing.")
    seed = nkeys.encode_seed(secrets.token_bytes(32), nkeys.PREFIX_BYTE_USER)
    pair = nkeys.from_seed(bytearray(seed))
    user = _checked(User(name=name, kind=kind, key=pair.public_key.decode(), added=today))
    write(folder, [*users, user])
    return user, seed.decode()


def remove(folder: Path, name: str) -> User:
    """The user whose key the broker takes no more, once it has read the list again. Raises FleetRefused."""
    users = read(folder)
    gone = next((user for user in users if user.name == name), None)
    if gone is None:
        raise FleetRefused(f"{name[:40]} is not in the list {folder / LIST}.")
    write(folder, [user for user in users if user is not gone])
    return gone


def write(folder: Path, users: Sequence[User]) -> None:
    """The list, and what the broker reads. Raises FleetRefused."""
    text = tomli_w.dumps({"user": [asdict(user) for user in users]})
    try:
        bounded_toml.loads(text)
        folder.mkdir(parents=True, exist_ok=True)
        durable_file.write(folder / LIST, text.encode())
        durable_file.write(folder / CONF, conf(users).encode())
    except bounded_toml.BadToml:
        raise FleetRefused(f"A list of {len(users)} is too long: use a broker of its own for the others.") from None
    except OSError as why:
        raise FleetRefused(f"The list cannot be written to {folder}: {why.strerror}.") from None


def conf(users: Sequence[User]) -> str:
    """What the broker reads. Nobody without a key in it gets in, also where the list is empty."""
    rows = [_row(user) for user in sorted(users, key=lambda user: user.name)]
    nobody = f'    {{user: nobody, password: {secrets.token_hex(32)}, permissions: {{publish: {{deny: ">"}}}}}}'
    return (
        "# Made by `catgraph fleet`: changes here are lost.\n"
        f"authorization {{\n  timeout: {KEY_WITHIN_S}\n  users = [\n" + "\n".join(rows or [nobody]) + "\n  ]\n}\n"
    )


def _row(user: User) -> str:
    allowed = orjson.dumps(permissions(user)).decode()
    return f"    # {user.kind} {user.name}\n    {{nkey: {user.key}, permissions: {allowed}}}"


def permissions(user: User) -> dict[str, Any]:
    """An agent: its own subjects, and replies to requests. A node: requests to agents, and the replies to them."""
    if user.kind == "agent":
        return {
            "publish": [wire.subject(user.name, "events"), wire.subject(user.name, "here")],
            "subscribe": [wire.subject(user.name, what) for what in ("pull.*", "ask", "http.*")],
            "allow_responses": {"max": 1, "ttl": "30s"},  # what a radio held up is late, and no missing right
        }
    return {
        "publish": [*(wire.subject("*", what) for what in ("pull.*", "ask", "http.*")), *_DEVICES],
        "subscribe": [wire.subject("*", "events"), wire.subject("*", "here"), "_INBOX.>"],
    }


def _checked(user: User) -> User:
    """Raises FleetRefused: the list is written into the broker's configuration as it is."""
    if not _NAME.fullmatch(user.name) or user.name == "cars":  # so is called the list of all of them
        raise FleetRefused(f"“{user.name[:40]}” is no name: use letters of ASCII, digits, - and _.")
    if user.kind not in ("agent", "web"):
        raise FleetRefused(f"{user.name} is neither an agent nor a web node.")
    if not _PUBLIC.fullmatch(user.key):
        raise FleetRefused(f"The key of {user.name} is no public key of a user.")
    return user
