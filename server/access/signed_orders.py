"""Decides whether an agent carries out what a web node passes on: who gave an order is proved by a signature.

A challenge is a moment of the agent's clock that nobody else can make. It is in every state that the agent sends. An
order that names one was signed after that moment: no clock of a device or a node counts.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import re
import secrets
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Literal

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature

from server.access.order_keys import KnownDevices, OrderKeys
from server.bus.bus import NotAdmitted
from server.control import display_name
from server.protocol import commands, signed_order
from server.protocol.signed_order import KEY_ID, SignedText

LIVES_S = 8.0  # a challenge: a frame is 3 s old at most, an order 3 s under way
MOST_REMEMBERED = 4096  # orders of the last `LIVES_S`, 512 a second
MOST_OF_ONE = 256  # of one key, 32 a second
ALWAYS_OF_ONE = 8  # has room whatever the others order
NOT_SIGNED = (
    "This order was not signed by the device that gives it, and this car requires that: open the page over HTTPS."
)
FORGED = "This order was not signed by the device it names, and was not carried out."
OTHER_CAR = "This order was signed for another car, and was not carried out."
ALTERED = "This order was altered on its way, and was not carried out."
TOO_OLD = "This order was signed too long ago, and was not carried out. Give it again."
REPLAYED = "This order was carried out before: it was sent a second time, and refused."
TOO_MANY = "Too many orders came at once: wait some seconds."
FULL = "Too many devices have given orders to this car: no new one is taken."
_OF_AGENT = ("mark_file",)  # of a route of the agent itself: no node sends it
_SENDER = frozenset(
    {"by", "who", "page", "person", "supervisors", "duties", "listed", "replaying", "console", "signed"}
)


class Challenges:
    """Of one run of an agent. Times are of its monotonic clock in seconds."""

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def new(self, now_s: float) -> str:
        moment = f"{int(now_s * 1000):x}"
        return f"{moment}.{self._proof(moment)}"

    def age_s(self, challenge: str, now_s: float) -> float | None:
        """Since it was made; None: it is none of this run."""
        moment, _, proof = challenge.partition(".")
        if not proof.isascii() or not hmac.compare_digest(proof, self._proof(moment)):
            return None
        return now_s - int(moment, 16) / 1000

    def _proof(self, moment: str) -> str:
        return hmac.new(self._secret, moment.encode("utf-8", "replace"), "sha256").hexdigest()[:24]


class SignedOrders:
    """Of one agent. `now`: its monotonic clock [s]; `wall_ms`: the time of day."""

    def __init__(
        self,
        keys: OrderKeys,
        *,
        known: KnownDevices | None,
        is_required: bool,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        note: Callable[[str, str, str], None],
    ) -> None:
        """`known`: only devices of this list; `is_required`: what is not signed is refused.

        `note` writes a line into the log of a car: its name, who did it, the line.
        """
        self._keys = keys
        self._known = known
        self._is_required = is_required
        self._now = now
        self._wall_ms = wall_ms
        self._note = note
        self._challenges = Challenges()
        self._seen: dict[tuple[str, bytes], float] = {}  # by sender and hash, oldest first: remembered until then [s]
        self._of_sender: Counter[str] = Counter()  # how many of them
        self._noted_s: dict[str, float] = {}  # when a refusal was written into a car's log

    def challenge(self) -> str:
        """What a device signs with its next order. The list of devices is as new as this, and no order waits for it."""
        if self._known is not None:
            self._known.look()
        return self._challenges.new(self._now())

    async def admit(self, vehicle: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """The message with who gave it, as it is proved. Raises NotAdmitted."""
        kind = message.get("kind")
        if kind in _OF_AGENT:
            raise NotAdmitted(commands.NO_SUCH)
        command = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
        if command is None or command.signature == "none":
            return self._stated(message, is_marked=False)
        is_kept = command.signature == "wanted"  # whatever its signature is worth
        if message.get("signed") is None:
            if self._is_required and not is_kept:
                raise NotAdmitted(NOT_SIGNED)
            return self._stated(message, is_marked=True)
        try:
            return await self._proved(vehicle, message, counts_as="record" if is_kept else "order")
        except NotAdmitted as why:
            if is_kept:
                return self._stated(message, is_marked=True)
            self._complain(vehicle, message, str(why))
            raise

    def _stated(self, message: Mapping[str, Any], *, is_marked: bool) -> Mapping[str, Any]:
        """The command as the node states it, trusted; but its sender is never this machine, nor a device that signs.

        `is_marked`: it should have been signed, and the name of its sender shows that it was not.
        """
        who, by = str(message.get("who") or ""), display_name.clean(message.get("by")) or display_name.NAMELESS
        is_key = re.fullmatch(KEY_ID, who) is not None and not is_marked
        known = self._keys.get(who) if is_key else None
        sender = {"by": by if known is None else known.name, "who": who if is_key else f"web:{who}", "console": False}
        if is_marked:
            sender["by"] = display_name.not_signed(by)
            if self._is_required:  # a device that can sign would have signed who is on duty there
                sender["person"] = None
        # A node's clock is another one; that what is not signed came in time is in the time given with the request.
        return {**{name: value for name, value in message.items() if name not in ("heard_ms", "signed")}, **sender}

    async def _proved(
        self, vehicle: str, message: Mapping[str, Any], *, counts_as: Literal["order", "record"]
    ) -> Mapping[str, Any]:
        """`counts_as`: the marks of a device, which may all come at once, leave its orders their room."""
        try:
            envelope = signed_order.read_envelope(message["signed"])
            id = _verify(envelope)
            text = signed_order.read_text(envelope.text)
        except (signed_order.NotReadable, InvalidSignature, ValueError):
            raise NotAdmitted(FORGED) from None
        who = message.get("who")
        if isinstance(who, str) and re.fullmatch(KEY_ID, who) and who != id:
            raise NotAdmitted(FORGED)
        if text.vehicle != vehicle:
            raise NotAdmitted(OTHER_CAR)
        if text.command.get("kind") != message.get("kind"):
            raise NotAdmitted(ALTERED)
        age_s = self._age_s(text)
        found = {**text.command, **_long(message, text)}
        listed = await self._listed(id)
        self._remember(f"{counts_as} {id}", hashlib.sha256(envelope.text.encode()).digest())
        by, line = (listed, None) if listed is not None else self._keys.name(id, text.by, now_ms=self._wall_ms())
        if line is not None:
            self._note(vehicle, by, line)
        if "heard_ms" in found:  # by the node's clock; the challenge gives it by this one
            found["heard_ms"] = self._wall_ms() - age_s * 1000
        sender = {
            "by": by,
            "who": id,
            "page": text.page,
            "person": _person(message, text),
            "supervisors": message.get("supervisors"),  # as the node states; it grants no right
            "duties": message.get("duties"),
            "listed": message.get("listed"),
            "console": False,
            "replaying": message.get("replaying"),
        }
        return {
            **{name: value for name, value in found.items() if name not in _SENDER},
            "id": message.get("id"),
            **sender,
        }

    def _age_s(self, text: SignedText) -> float:
        age_s = self._challenges.age_s(text.challenge, self._now())
        if age_s is None or age_s > LIVES_S:
            raise NotAdmitted(TOO_OLD)
        return age_s

    async def _listed(self, id: str) -> str | None:
        """The name of the device in the operator's list; None: there is none. Changes nothing; raises NotAdmitted."""
        if self._known is not None:
            name = await self._known.name(id)
            if name is None:
                raise NotAdmitted(f"This car takes orders of listed devices only; the key of this one is {id}.")
            return name
        if self._keys.get(id) is None and self._keys.is_full:
            raise NotAdmitted(FULL)
        return None

    def _remember(self, sender: str, digest: bytes) -> None:
        now_s = self._now()
        for old, until_s in tuple(self._seen.items()):
            if until_s >= now_s:
                break
            del self._seen[old]
            self._of_sender[old[0]] -= 1
            if self._of_sender[old[0]] <= 0:
                del self._of_sender[old[0]]
        if (sender, digest) in self._seen:
            raise NotAdmitted(REPLAYED)
        if self._of_sender[sender] >= (ALWAYS_OF_ONE if len(self._seen) >= MOST_REMEMBERED else MOST_OF_ONE):
            raise NotAdmitted(TOO_MANY)
        self._seen[sender, digest] = now_s + LIVES_S
        self._of_sender[sender] += 1

    def _complain(self, vehicle: str, message: Mapping[str, Any], why: str) -> None:
        """An order that is not what it claims is in the log of the car, at most one in 10 s."""
        now_s = self._now()
        if why not in (FORGED, OTHER_CAR, ALTERED, REPLAYED) or now_s - self._noted_s.get(vehicle, -10.0) < 10.0:
            return
        self._noted_s[vehicle] = now_s
        self._note(vehicle, display_name.clean(message.get("by")) or "", f"{why} A web node passed it on.")


def _verify(envelope: signed_order.Envelope) -> str:
    """The id of the key that signed it. Raises InvalidSignature, or ValueError where key or signature is none."""
    try:
        point = base64.b64decode(envelope.key, validate=True)
        signature = base64.b64decode(envelope.signature, validate=True)
    except binascii.Error as why:
        raise ValueError(str(why)) from None
    if len(point) != signed_order.KEY_BYTES or len(signature) != signed_order.SIGNATURE_BYTES:
        raise ValueError("of another length")
    key = ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), point)
    der = encode_dss_signature(int.from_bytes(signature[:32], "big"), int.from_bytes(signature[32:], "big"))
    key.verify(der, signed_order.PREFIX + envelope.text.encode(), ec.ECDSA(hashes.SHA256()))
    return signed_order.key_id(point)


def _person(message: Mapping[str, Any], text: SignedText) -> dict[str, Any] | None:
    """Who is on duty, as the device states; for which device, as its node states."""
    if text.person is None:
        return None
    stated = message.get("person")
    return {**text.person.model_dump(), "device": stated.get("device") if isinstance(stated, Mapping) else None}


def _long(message: Mapping[str, Any], text: SignedText) -> dict[str, Any]:
    """The arguments of which only the hash is signed. Raises NotAdmitted where one is another."""
    found = {}
    for name, digest in text.hashes.items():
        value = message.get(name)
        if not isinstance(value, str) or hashlib.sha256(value.encode("utf-8", "replace")).hexdigest() != digest:
            raise NotAdmitted(ALTERED)
        found[name] = value
    return found
