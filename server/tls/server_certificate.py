"""The server's own certificate: for the names it has now, for 397 days, signed by its own authority."""

from __future__ import annotations

import datetime as dt
import ipaddress
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from server.storage import durable_file
from server.tls.authority import BACK as AUTHORITY_BACK
from server.tls.authority import Authority, clock, private_pem
from server.tls.names import IpAddress, Names

FILE = "leaf.pem"
VALID = dt.timedelta(days=397)  # from end to end; browsers refuse more than 398 (Apple, Chrome, since 2020-09-01)
BACK = dt.timedelta(days=30)  # of these are before now, for slow clocks of phones and fast clocks of servers
RENEW = dt.timedelta(days=60)  # before the end: a server that is switched on once in two months never has an old one


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerCertificate:
    """A certificate for this server and its key."""

    cert: x509.Certificate
    key: ec.EllipticCurvePrivateKey

    @property
    def pem(self) -> bytes:
        """Key and certificate, as a TLS library loads them."""
        return private_pem(self.key) + self.cert.public_bytes(serialization.Encoding.PEM)


def make(authority: Authority, names: Names, *, now: dt.datetime) -> ServerCertificate:
    """Issue a certificate for `names` at the time `now`."""
    key = ec.generate_private_key(ec.SECP256R1())
    start = _clock(authority, now).replace(microsecond=0) - BACK
    # RFC 5280 4.1.2.5: both ends belong to it, so that a second less is 397 days.
    end = min(start + VALID - dt.timedelta(seconds=1), authority.cert.not_valid_after_utc)
    builder = (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, names.dns[0][:64])]))
        .issuer_name(authority.cert.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(start)
        .not_valid_after(end)
        .add_extension(_alternatives(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_SIGNS, critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.key.public_key()), critical=False)
    )
    return ServerCertificate(cert=builder.sign(authority.key, hashes.SHA256()), key=key)


def why_renew(leaf: ServerCertificate, authority: Authority, names: Names, *, now: dt.datetime) -> str | None:
    """Why this certificate has to be renewed, as text for the log; None: it has not."""
    at = _clock(authority, now)
    try:
        leaf.cert.verify_directly_issued_by(authority.cert)
    except (ValueError, TypeError, InvalidSignature):
        return "the authority is another"
    if leaf.cert.extensions.get_extension_for_class(x509.SubjectAlternativeName).value != _alternatives(names):
        return "this machine's addresses or names changed"
    if at < leaf.cert.not_valid_before_utc + dt.timedelta(days=1):
        return "the clock was put back"
    if (
        at > leaf.cert.not_valid_after_utc - RENEW
        and leaf.cert.not_valid_after_utc < authority.cert.not_valid_after_utc
    ):
        return f"it would have ended on {leaf.cert.not_valid_after_utc:%Y-%m-%d}"
    return None


def addresses_of(leaf: ServerCertificate) -> list[IpAddress]:
    """The addresses it is for."""
    names = leaf.cert.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    found = names.get_values_for_type(x509.IPAddress)
    return [ip for ip in found if isinstance(ip, ipaddress.IPv4Address | ipaddress.IPv6Address)]


def load(folder: Path) -> ServerCertificate | None:
    """The one kept in `folder`; None where there is none that can be read: a new one costs nothing."""
    try:
        text = (folder / FILE).read_bytes()
        key = serialization.load_pem_private_key(text, password=None)
        cert = x509.load_pem_x509_certificate(text)
        cert.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except (OSError, ValueError, TypeError, x509.ExtensionNotFound):
        return None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != cert.public_key():
        return None
    return ServerCertificate(cert=cert, key=key)


def keep(folder: Path, leaf: ServerCertificate) -> Path:
    """Writes it, readable for its owner only, and returns where. Raises OSError."""
    path = folder / FILE
    durable_file.write(path, leaf.pem, mode=0o600)
    return path


def _clock(authority: Authority, now: dt.datetime) -> dt.datetime:
    """The authority was made by this very clock, so a time before that is wrong: a machine whose clock has no battery
    wakes up in the past, and the phones do not."""
    return max(clock(now), authority.cert.not_valid_before_utc + AUTHORITY_BACK)


def _alternatives(names: Names) -> x509.SubjectAlternativeName:
    addresses: list[x509.GeneralName] = [x509.IPAddress(ip) for ip in sorted(names.ips, key=str)]
    return x509.SubjectAlternativeName([*(x509.DNSName(name) for name in sorted(names.dns)), *addresses])


_SIGNS = x509.KeyUsage(
    digital_signature=True,
    content_commitment=False,
    key_encipherment=False,
    data_encipherment=False,
    key_agreement=False,
    key_cert_sign=False,
    crl_sign=False,
    encipher_only=False,
    decipher_only=False,
)
