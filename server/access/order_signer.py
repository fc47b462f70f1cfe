"""Signs commands as a paired device does: for programs that act through a web node, and for tests.

    signer = OrderSigner.load(Path("ci.pem"))
    headers = signer.header({"kind": "pause"}, vehicle="ocelot", by="nightly test", challenge=challenge)
    httpx.post("https://node/api/pause?vehicle=ocelot", headers=headers)

`challenge` is `server.challenge` of `GET /api/state?vehicle=ocelot`, no older than some seconds.
"""

from __future__ import annotations

import base64
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import orjson
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from server.protocol import signed_order

HEADER = "X-Catgraph-Signed"


class OrderSigner:
    """By one private key of the curve P-256."""

    def __init__(self, key: ec.EllipticCurvePrivateKey | None = None) -> None:
        """None: by a new key."""
        self._key = key or ec.generate_private_key(ec.SECP256R1())
        point = self._key.public_key().public_bytes(
            serialization.Encoding.X962, serialization.PublicFormat.UncompressedPoint
        )
        self._point = base64.b64encode(point).decode()
        self.id = signed_order.key_id(point)

    @classmethod
    def load(cls, path: Path) -> OrderSigner:
        """From a PEM file without a password. Raises OSError, and ValueError where it is no such key."""
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
        if not isinstance(key, ec.EllipticCurvePrivateKey) or not isinstance(key.curve, ec.SECP256R1):
            raise ValueError(f"{path} is no private key of the curve P-256.")
        return cls(key)

    def sign(
        self, command: Mapping[str, Any], *, vehicle: str, by: str, challenge: str, page: str | None = None, **more: Any
    ) -> dict[str, str]:
        """What is sent as `signed`; `more`: further fields of the text."""
        nonce = secrets.token_urlsafe(16)
        fields = {
            "command": command,
            "vehicle": vehicle,
            "by": by,
            "page": page,
            "challenge": challenge,
            "nonce": nonce,
        }
        return self.sign_text(orjson.dumps({**fields, **more}).decode())

    def sign_text(self, text: str) -> dict[str, str]:
        made = self._key.sign(signed_order.PREFIX + text.encode(), ec.ECDSA(hashes.SHA256()))
        r, s = decode_dss_signature(made)
        signature = base64.b64encode(r.to_bytes(32, "big") + s.to_bytes(32, "big")).decode()
        return {"text": text, "key": self._point, "signature": signature}

    def header(self, command: Mapping[str, Any], *, vehicle: str, by: str, challenge: str) -> dict[str, str]:
        """The header of a request over HTTP whose command is this one."""
        signed = self.sign(command, vehicle=vehicle, by=by, challenge=challenge)
        return {HEADER: base64.b64encode(orjson.dumps(signed)).decode()}
