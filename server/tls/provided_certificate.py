"""A certificate that is provided (`--tls CERT KEY`): its check, with a sentence for each fault."""

from __future__ import annotations

import datetime as dt
import ssl
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from server.tls.authority import TlsRefused

SOON = dt.timedelta(days=14)  # warning before the expiry


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvidedCertificate:
    """What a pair of files holds."""

    cert: x509.Certificate
    names: tuple[str, ...]
    warning: str | None  # it can be served, but somebody should see to it


def look(cert: Path, key: Path, *, now: dt.datetime) -> ProvidedCertificate:
    """Read certificate and key. Raises TlsRefused with the reason, which browsers would not show."""
    found = _certificate(cert)
    _check_pair(cert, key, found)
    if now > found.not_valid_after_utc:
        raise TlsRefused(f"The certificate {cert} expired on {found.not_valid_after_utc:%Y-%m-%d %H:%M} UTC.")
    warning = None
    if now < found.not_valid_before_utc:
        warning = f"the certificate {cert} is valid from {found.not_valid_before_utc:%Y-%m-%d %H:%M} UTC only"
    elif found.not_valid_after_utc - now < SOON:
        warning = f"the certificate {cert} expires on {found.not_valid_after_utc:%Y-%m-%d}"
    names = _names(found)
    if not names:
        raise TlsRefused(f"The certificate {cert} names no host (subject alternative names): no browser takes it.")
    return ProvidedCertificate(cert=found, names=names, warning=warning)


def _certificate(path: Path) -> x509.Certificate:
    try:
        chain = x509.load_pem_x509_certificates(path.read_bytes())
    except OSError as why:
        raise TlsRefused(f"The certificate {path} cannot be read: {why.strerror or why}.") from None
    except ValueError:
        raise TlsRefused(f"{path} holds no certificate as PEM (-----BEGIN CERTIFICATE-----).") from None
    return chain[0]


def _check_pair(cert: Path, key: Path, found: x509.Certificate) -> None:
    try:
        private = serialization.load_pem_private_key(key.read_bytes(), password=None)
    except OSError as why:
        raise TlsRefused(f"The key {key} cannot be read: {why.strerror or why}.") from None
    except TypeError:
        raise TlsRefused(f"The key {key} is protected by a password: give one without.") from None
    except ValueError:
        raise TlsRefused(f"{key} holds no private key as PEM (-----BEGIN PRIVATE KEY-----).") from None
    if private.public_key() != found.public_key():
        raise TlsRefused(f"The key {key} belongs to another certificate than the first in {cert}.")
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(cert, key)
    except (ssl.SSLError, OSError) as why:
        raise TlsRefused(f"The certificate {cert} cannot be served: {getattr(why, 'reason', None) or why}.") from None


def _names(cert: x509.Certificate) -> tuple[str, ...]:
    try:
        named = cert.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (x509.ExtensionNotFound, ValueError):
        return ()
    addresses = [str(ip) for ip in named.get_values_for_type(x509.IPAddress)]
    return (*named.get_values_for_type(x509.DNSName), *addresses)
