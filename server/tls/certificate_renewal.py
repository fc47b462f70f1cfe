"""Keeps the certificate that is shown the right one while the server runs: renewed, or read again from its files.

One that is provided (`--tls CERT KEY`) is checked first, with a sentence for each fault.

A new certificate gets its own context, which each new handshake uses, with or without a server name (browsers send none
for an address). A context changed in place could keep the old certificate beside the new one if their key types differ.
"""

from __future__ import annotations

import asyncio
import datetime as dt
import logging
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from server.tls import server_certificate
from server.tls.authority import Authority, TlsRefused, load_or_make
from server.tls.names import Names

EXPIRES_SOON = dt.timedelta(days=14)  # warning before the expiry


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvidedCertificate:
    """What a pair of files holds."""

    cert: x509.Certificate
    names: tuple[str, ...]
    warning: str | None  # it can be served, but somebody should see to it


def read_provided(cert: Path, key: Path, *, now: dt.datetime) -> ProvidedCertificate:
    """Read certificate and key. Raises TlsRefused with the reason, which browsers would not show."""
    found = _certificate(cert)
    _check_pair(cert, key, found)
    if now > found.not_valid_after_utc:
        raise TlsRefused(f"The certificate {cert} expired on {found.not_valid_after_utc:%Y-%m-%d %H:%M} UTC.")
    warning = None
    if now < found.not_valid_before_utc:
        warning = f"the certificate {cert} is valid from {found.not_valid_before_utc:%Y-%m-%d %H:%M} UTC only"
    elif found.not_valid_after_utc - now < EXPIRES_SOON:
        warning = f"the certificate {cert} expires on {found.not_valid_after_utc:%Y-%m-%d}"
    names = _names_in(found)
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


def _names_in(cert: x509.Certificate) -> tuple[str, ...]:
    try:
        named = cert.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (x509.ExtensionNotFound, ValueError):
        return ()
    addresses = [str(ip) for ip in named.get_values_for_type(x509.IPAddress)]
    return (*named.get_values_for_type(x509.DNSName), *addresses)


log = logging.getLogger("catgraph.tls")

LOOK_EVERY_S = 5.0  # a phone that waits for the laptop to join its network waits no longer than this


class LiveContext:
    """A TLS context whose certificate can be exchanged while it serves.

    `ssl` is given to the server once; `use` exchanges what new connections are shown.
    """

    def __init__(self, cert: Path, key: Path | None = None) -> None:
        """Raises OSError, ssl.SSLError and ValueError as `use` does."""
        self.ssl = _context(cert, key)
        self._now = self.ssl
        self.ssl.sni_callback = self._lead

    def use(self, cert: Path, key: Path | None = None) -> None:
        """Shows new connections this chain. Raises OSError, ssl.SSLError or ValueError: then nothing has changed."""
        self._now = _context(cert, key)

    def _lead(self, connection: ssl.SSLObject, name: str | None, first: ssl.SSLContext) -> None:
        connection.context = self._now


def _context(cert: Path, key: Path | None) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # every browser since 2014 has it
    context.set_alpn_protocols(["http/1.1"])
    context.options |= ssl.OP_NO_TICKET  # a resumed session would keep the old certificate
    context.num_tickets = 0
    context.load_cert_chain(cert, key, password=_no_password)
    return context


def _no_password() -> str:
    raise ValueError("the key is protected by a password")


class Certificate(Protocol):
    """A source of a certificate that can be renewed."""

    context: LiveContext

    def refresh(self, now: dt.datetime) -> str | None:
        """Renew the certificate if needed and log it. Never raises because of files."""


class OwnCertificate:
    """Signed by our own authority, for the names this machine has."""

    def __init__(self, folder: Path, names: Callable[[], Names], *, host: str, now: dt.datetime) -> None:
        """Raises TlsRefused."""
        self.authority: Authority = load_or_make(folder, host=host, now=now)
        if now > self.authority.cert.not_valid_after_utc:
            raise TlsRefused(
                f"The server's own authority in {folder} ended on {self.authority.cert.not_valid_after_utc:%Y-%m-%d}: "
                "delete the folder for a new one, then set up every phone again (or set this machine's clock)."
            )
        self._folder = folder
        self._names_now = names
        self._failing = ""
        try:
            self.names = names()
            kept = server_certificate.load(folder)
            if kept is None or server_certificate.why_renew(kept, self.authority, self.names, now=now):
                kept = server_certificate.make(self.authority, self.names, now=now)
            self.leaf = kept
            self.context = LiveContext(server_certificate.keep(folder, kept))
        except (OSError, ssl.SSLError) as why:
            raise TlsRefused(f"The server's certificate in {folder} cannot be used: {why.strerror or why}.") from None

    def refresh(self, now: dt.datetime) -> str | None:
        """Renews it when the addresses changed or its end comes near."""
        try:
            names = self._names_now()
            why = server_certificate.why_renew(self.leaf, self.authority, names, now=now)
            if why is None:
                return None
            fresh = server_certificate.make(self.authority, names, now=now)
            self.context.use(server_certificate.keep(self._folder, fresh))
        except (OSError, ssl.SSLError) as failed:
            return self._once(f"the certificate cannot be renewed, the one before stays: {failed}")
        self.leaf, self.names, self._failing = fresh, names, ""
        addresses = ", ".join(str(ip) for ip in names.reachable) or "no network"
        return f"a new certificate, because {why}: {', '.join(names.dns)}, {addresses}"

    def _once(self, failing: str) -> str | None:
        if failing == self._failing:
            return None
        self._failing = failing
        return failing


class ProvidedCertificateRenewal:
    """The one of `--tls CERT KEY`."""

    def __init__(self, cert: Path, key: Path, *, now: dt.datetime) -> None:
        """Raises TlsRefused."""
        self._cert, self._key = cert, key
        self.given = read_provided(cert, key, now=now)
        self._seen = self._stamps()
        self._reported = self.given.warning
        try:
            self.context = LiveContext(cert, key)
        except (OSError, ssl.SSLError, ValueError) as why:
            raise TlsRefused(f"The certificate {cert} cannot be served: {why}.") from None

    def refresh(self, now: dt.datetime) -> str | None:
        """Shows what the files hold now, if they changed and it is good; else the one before stays."""
        stamps = self._stamps()
        if stamps == self._seen:
            return self._grown_old(now)
        if stamps is not None:
            self._seen = stamps
        try:
            fresh = read_provided(self._cert, self._key, now=now)
            self.context.use(self._cert, self._key)
        except (TlsRefused, OSError, ssl.SSLError, ValueError) as why:
            return self._once(f"the certificate of before stays, for the changed one cannot be served: {why}")
        self.given, self._reported = fresh, fresh.warning
        ends = f"{fresh.cert.not_valid_after_utc:%Y-%m-%d}"
        return f"the certificate {self._cert} was read again, it ends on {ends}"

    def _grown_old(self, now: dt.datetime) -> str | None:
        left = self.given.cert.not_valid_after_utc - now
        if left < dt.timedelta(0):
            return self._once(f"the certificate {self._cert} expired: no browser takes it any more")
        if left < EXPIRES_SOON:
            return self._once(f"the certificate {self._cert} expires on {self.given.cert.not_valid_after_utc:%Y-%m-%d}")
        return None

    def _once(self, notice: str) -> str | None:
        if notice == self._reported:
            return None
        self._reported = notice
        return notice

    def _stamps(self) -> tuple[tuple[int, int, int], ...] | None:
        """What changes when the files do, also when a link is led to others, as certbot does; None: not there now."""
        try:
            return tuple((s.st_mtime_ns, s.st_size, s.st_ino) for s in (self._cert.stat(), self._key.stat()))
        except OSError:
            return None


async def keep(
    certificate: Certificate,
    *,
    now: Callable[[], dt.datetime],
    on_renewed: Callable[[], None] = lambda: None,
    every_s: float = LOOK_EVERY_S,
) -> None:
    """Renew the certificate when due, until cancelled; call `on_renewed` after each renewal. Failures are retried."""
    last = ""
    while True:
        await asyncio.sleep(every_s)
        try:
            notice = await asyncio.to_thread(certificate.refresh, now())
            if notice is not None:
                log.warning("%s", notice)
                on_renewed()
        except Exception as bug:
            if repr(bug) != last:
                log.exception("the certificate could not be checked; it is retried")
            last = repr(bug)
