"""The authority of one server: made once, kept in the data folder, trusted by the phones of the crew.

Key and certificate are one file, so that there is never one without the other. It is P-256, which every phone supports,
and may sign for private names only; see names.py.
"""

from __future__ import annotations

import datetime as dt
import logging
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from server.storage import durable_file
from server.tls.names import DOMAINS, RANGES

log = logging.getLogger("catgraph.tls")

FILE = "authority.pem"
VALID = dt.timedelta(days=3650)  # ten years: a phone is set up once
BACK = dt.timedelta(days=730)  # for phones whose clock is behind; and the server's may be ahead when it is made
EARLIEST = dt.datetime(2026, 11, 1, tzinfo=dt.UTC)  # nothing of ours is older: an earlier clock is wrong


class TlsRefused(Exception):
    """HTTPS cannot be served; `str()` is one sentence for a person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Authority:
    """A certificate that phones trust, and its signing key."""

    cert: x509.Certificate
    key: ec.EllipticCurvePrivateKey

    @property
    def name(self) -> str:
        """As phones list it."""
        return str(self.cert.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)

    @property
    def der(self) -> bytes:
        return self.cert.public_bytes(serialization.Encoding.DER)

    @property
    def pem(self) -> bytes:
        return self.cert.public_bytes(serialization.Encoding.PEM)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the certificate in pairs of hexadecimal digits with colons, as phones show it."""
        return fingerprint_of(self.cert)


def fingerprint_of(cert: x509.Certificate) -> str:
    """SHA-256 of a certificate as phones show it."""
    return cert.fingerprint(hashes.SHA256()).hex(":").upper()


def clock(now: dt.datetime) -> dt.datetime:
    """The time for certificates: a clock before catgraph existed counts as wrong."""
    return max(now, EARLIEST)


def load_or_make(folder: Path, *, host: str, now: dt.datetime) -> Authority:
    """The authority kept in `folder`, or a new one for a machine called `host`. Raises TlsRefused."""
    path = folder / FILE
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not path.exists():
            _keep(path, make(host=host, now=now))
        _close_to_others(path)
        return _load(path)
    except OSError as why:
        raise TlsRefused(f"The server's own authority in {path} cannot be used: {why.strerror or why}.") from None


def make(*, host: str, now: dt.datetime) -> Authority:
    """A new authority, valid from well before `now` for ten years after it."""
    key = ec.generate_private_key(ec.SECP256R1())
    # A phone may trust several servers: the last digits distinguish machines of the same name.
    common = f"catgraph {host[:40] or 'server'} {secrets.token_hex(2).upper()}"
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])
    start = clock(now).replace(microsecond=0)
    permitted: list[x509.GeneralName] = [x509.DNSName(domain) for domain in DOMAINS]
    permitted += [x509.IPAddress(network) for network in RANGES]
    identity = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    builder = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(start - BACK)
        .not_valid_after(start + VALID)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_only(key_cert_sign=True, crl_sign=True), critical=True)
        .add_extension(x509.NameConstraints(permitted_subtrees=permitted, excluded_subtrees=None), critical=True)
        .add_extension(identity, critical=False)
    )
    return Authority(cert=builder.sign(key, hashes.SHA256()), key=key)


def _only(*, key_cert_sign: bool = False, crl_sign: bool = False) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=key_cert_sign,
        crl_sign=crl_sign,
        encipher_only=False,
        decipher_only=False,
    )


def _load(path: Path) -> Authority:
    text = path.read_bytes()
    try:
        key = serialization.load_pem_private_key(text, password=None)
        cert = x509.load_pem_x509_certificate(text)
    except (ValueError, TypeError) as why:
        raise _unusable(path, f"it cannot be read ({why})") from None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != cert.public_key():
        raise _unusable(path, "its key is not that of its certificate")
    return Authority(cert=cert, key=key)


def _unusable(path: Path, why: str) -> TlsRefused:
    # Never replaced silently: every phone that trusts the old one would fail without a visible reason.
    return TlsRefused(
        f"The server's own authority in {path} is damaged: {why}. Put back a copy, or delete the file for a new one; "
        "then every phone must be set up again."
    )


def _keep(path: Path, authority: Authority) -> None:
    """Writes it whole or not at all, and where another server made one at the same time, that one stays."""
    durable_file.create(path, private_pem(authority.key) + authority.pem, mode=0o600)


def private_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """A key as PEM, not encrypted: the mode of its file protects it."""
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _close_to_others(path: Path) -> None:
    if os.name == "posix" and path.stat().st_mode & 0o077:
        log.warning("%s could be read by others of this machine: now only by its owner", path)
        path.chmod(0o600)
