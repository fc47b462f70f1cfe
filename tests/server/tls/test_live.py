"""A certificate that is exchanged while the server runs: new connections see it, old ones go on."""

from __future__ import annotations

import asyncio
import datetime as dt
import ipaddress
import logging
import ssl
import warnings
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from cryptography import x509

from server.tls.certificate_renewal import LiveContext, OwnCertificate, ProvidedCertificateRenewal, keep
from server.tls.names import IpAddress, Names, names_of
from tests.server.tls.certificates import pair

NOW = dt.datetime.now(dt.UTC)
HOME = ipaddress.ip_address("192.168.4.1")
FIELD = ipaddress.ip_address("10.20.0.7")


class Machine:
    """A machine whose interfaces come and go."""

    def __init__(self, *addresses: IpAddress) -> None:
        self.addresses = list(addresses)
        self.is_broken = False

    def names(self) -> Names:
        if self.is_broken:
            raise OSError("no interfaces")
        return names_of(self.addresses, "pit")


class Listening:
    """A TLS server that answers with what it was sent."""

    def __init__(self, context: LiveContext) -> None:
        self._context = context
        self.port = 0

    async def start(self) -> asyncio.Server:
        async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                writer.write(line)
                await writer.drain()
            writer.close()

        server = await asyncio.start_server(echo, "127.0.0.1", 0, ssl=self._context.ssl)
        self.port = server.sockets[0].getsockname()[1]
        return server

    async def connect(self, trusted: ssl.SSLContext, name: str | None) -> tuple[x509.Certificate, Line]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port, ssl=trusted, server_hostname=name or "")
        der = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
        return x509.load_der_x509_certificate(der), Line(reader, writer)


class Line:
    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    async def sends(self, text: bytes) -> bytes:
        self._writer.write(text + b"\n")
        return (await self._reader.readline()).strip()

    async def end(self) -> None:
        self._writer.close()
        await self._writer.wait_closed()


@pytest.fixture
def machine() -> Machine:
    return Machine(HOME)


@pytest.fixture
async def own(tmp_path: Path, machine: Machine) -> AsyncIterator[tuple[OwnCertificate, Listening]]:
    certificate = OwnCertificate(tmp_path / "tls", machine.names, host="pit", now=NOW)
    listening = Listening(certificate.context)
    server = await listening.start()
    yield certificate, listening
    server.close()
    await server.wait_closed()


def trusting(certificate: OwnCertificate) -> ssl.SSLContext:
    return ssl.create_default_context(cadata=certificate.authority.pem.decode())


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"], ids=["named", "by address, without a name"])
async def test_new_connections_see_the_renewed_one_and_old_ones_go_on(
    own: tuple[OwnCertificate, Listening], machine: Machine, name: str
) -> None:
    certificate, listening = own
    first, old = await listening.connect(trusting(certificate), name)
    machine.addresses = [FIELD]
    notice = certificate.refresh(NOW)
    assert notice is not None
    assert "addresses or names changed" in notice
    assert str(FIELD) in notice
    second, new = await listening.connect(trusting(certificate), name)
    assert second.serial_number != first.serial_number
    names = second.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert FIELD in names.get_values_for_type(x509.IPAddress)
    assert HOME not in names.get_values_for_type(x509.IPAddress)
    assert await old.sends(b"still here") == b"still here"
    assert await new.sends(b"here too") == b"here too"
    await old.end()
    await new.end()


async def test_a_session_of_before_is_not_resumed_with_the_old_one(
    own: tuple[OwnCertificate, Listening], machine: Machine
) -> None:
    certificate, listening = own
    context = trusting(certificate)
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    _, line = await listening.connect(context, "localhost")
    assert await line.sends(b"x") == b"x"
    session = line._writer.get_extra_info("ssl_object").session
    assert session is None or not session.has_ticket
    await line.end()


async def test_tls_1_1_is_refused(own: tuple[OwnCertificate, Listening]) -> None:
    certificate, listening = own
    old = trusting(certificate)
    old.set_ciphers("ALL:@SECLEVEL=0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
    with pytest.raises((ssl.SSLError, ConnectionError)):
        await listening.connect(old, "localhost")


def test_the_same_certificate_is_shown_after_a_restart(tmp_path: Path, machine: Machine) -> None:
    first = OwnCertificate(tmp_path, machine.names, host="pit", now=NOW)
    second = OwnCertificate(tmp_path, machine.names, host="pit", now=NOW + dt.timedelta(days=1))
    assert second.leaf.cert.serial_number == first.leaf.cert.serial_number
    machine.addresses.append(FIELD)
    third = OwnCertificate(tmp_path, machine.names, host="pit", now=NOW + dt.timedelta(days=1))
    assert third.leaf.cert.serial_number != first.leaf.cert.serial_number
    assert third.authority.fingerprint == first.authority.fingerprint


def test_what_cannot_be_renewed_stays_and_is_reported_once(tmp_path: Path, machine: Machine) -> None:
    certificate = OwnCertificate(tmp_path, machine.names, host="pit", now=NOW)
    machine.is_broken = True
    assert "cannot be renewed, the one before stays" in str(certificate.refresh(NOW))
    assert certificate.refresh(NOW) is None
    machine.is_broken = False
    machine.addresses = [FIELD]
    assert "a new certificate" in str(certificate.refresh(NOW))


async def test_another_kind_of_key_leaves_nothing_of_the_old_one(tmp_path: Path) -> None:
    """A context that is changed in place keeps an RSA certificate beside one of EC, and picks as it likes."""
    files = pair(tmp_path, start=NOW - dt.timedelta(days=1), is_rsa=True)
    certificate = ProvidedCertificateRenewal(files.cert, files.key, now=NOW)
    listening = Listening(certificate.context)
    server = await listening.start()
    for is_rsa in (False, True):
        files = pair(tmp_path, start=NOW - dt.timedelta(days=1), is_rsa=is_rsa)
        assert certificate.refresh(NOW)
        trusted = ssl.create_default_context(cafile=files.cert)
        seen, line = await listening.connect(trusted, "localhost")
        assert seen.serial_number == files.serial
        await line.end()
    server.close()
    await server.wait_closed()


async def test_looking_after_it_survives_a_bug_in_one_look(
    tmp_path: Path, machine: Machine, caplog: pytest.LogCaptureFixture
) -> None:
    certificate = OwnCertificate(tmp_path, machine.names, host="pit", now=NOW)
    renewed = asyncio.Event()
    looks = iter((None, None, NOW, NOW))

    def clock() -> dt.datetime:
        if (now := next(looks, NOW)) is None:
            raise RuntimeError("a bug")
        return now

    machine.addresses = [FIELD]
    with caplog.at_level(logging.WARNING):
        task = asyncio.create_task(keep(certificate, now=clock, on_renewed=renewed.set, every_s=0.01))
        async with asyncio.timeout(5):
            await renewed.wait()
        task.cancel()
    assert caplog.text.count("the certificate could not be checked") == 1  # not at every look
    assert "a new certificate" in caplog.text
