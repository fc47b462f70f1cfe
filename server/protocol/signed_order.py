"""A command that is signed by the device that gives it, for agents that do not trust a web node on who sent it.

The signature (ECDSA, P-256, SHA-256) is of `PREFIX` and the very text that is sent: nothing is serialized again in
between, and the agent carries out the text, whatever is beside it.
"""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from server.protocol.command_base import Name, PageName

PREFIX = b"catgraph order 1\n"
LONGEST = 40_000  # letters of a text; a page's message has 16 kB
KEY_BYTES = 65  # an uncompressed point
SIGNATURE_BYTES = 64  # r and s
KEY_ID = r"k[0-9a-f]{32}"


class NotReadable(ValueError):
    """It is no signed command."""


class Envelope(BaseModel):
    """What is sent in the field `signed` of a command."""

    model_config = ConfigDict(strict=True, frozen=True)
    text: Annotated[str, Field(max_length=LONGEST)]
    key: Annotated[str, Field(max_length=100, description="public key: an uncompressed point of P-256, base64")]
    signature: Annotated[str, Field(max_length=100, description="r and s of 32 bytes each, base64")]


class SignedPerson(BaseModel):
    """Who is on duty at the device."""

    model_config = ConfigDict(strict=True, frozen=True)
    name: Annotated[str, Field(max_length=200)]
    role: Annotated[str, Field(max_length=40)]


class SignedText(BaseModel):
    """The content of an envelope's text, as JSON."""

    model_config = ConfigDict(strict=True, frozen=True)
    command: dict[str, Any]  # with its kind
    vehicle: Name
    by: Annotated[str, Field(max_length=200)]  # how the device is called
    page: PageName | None = None  # None: a program
    person: SignedPerson | None = None  # None: nobody is on duty there
    challenge: Annotated[str, Field(max_length=60)]  # of the vehicle's agent, from its newest state
    nonce: Annotated[str, Field(min_length=16, max_length=60)]
    hashes: dict[str, str] = {}  # SHA-256 in hex of arguments that are sent beside it because they are long


def read_envelope(found: Any) -> Envelope:
    """Raises NotReadable."""
    try:
        return Envelope.model_validate(found)
    except ValidationError:
        raise NotReadable("no envelope") from None


def read_text(text: str) -> SignedText:
    """Raises NotReadable."""
    try:
        return SignedText.model_validate_json(text)
    except ValidationError:
        raise NotReadable("no text of an order") from None


def key_id(point: bytes) -> str:
    """By which a key is called."""
    return f"k{hashlib.sha256(point).hexdigest()[:32]}"


def short(id: str) -> str:
    """Of a key's id, as people compare it."""
    return id[1:9]
