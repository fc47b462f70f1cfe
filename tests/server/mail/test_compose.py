"""Mails as files: read back by Python's own parser they are what was ordered, and no head is added."""

from __future__ import annotations

import hashlib
import re
import tempfile
import threading
import tracemalloc
from email import message_from_bytes
from email.header import decode_header, make_header
from email.message import EmailMessage
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.mail import address, compose
from server.mail.compose import Attachment, Draft, Stopped
from tests.server.mail.mailing import START_MS
from tests.server.mail.post import read

ANN, JORG = address.parse("ann@example.org"), address.parse("jörg@bücher.example")
LINE = st.text(st.characters(exclude_categories=("Cc", "Cs", "Zl", "Zp")), max_size=120).filter(compose.is_one_line)

HEADERS = ["Date", "From", "To", "Message-ID", "Subject", "Content-Type", "Content-Transfer-Encoding", "MIME-Version"]


def draft(**more: Any) -> Draft:
    facts: dict[str, Any] = {
        "sender": ANN,
        "sender_name": "",
        "to": [ANN],
        "subject": "Drive",
        "at_ms": START_MS,
        "message_id": "<key.1of1@example.org>",
        "text": "Hello",
        **more,
    }
    return Draft(**facts)


def written(tmp_path: Path, **more: Any) -> Path:
    path = tmp_path / "mail.eml"
    path.unlink(missing_ok=True)
    size = compose.write(draft(**more), path, threading.Event())
    assert size == path.stat().st_size
    return path


def test_a_mail_has_what_every_mail_must_have(tmp_path: Path) -> None:
    mail = read(written(tmp_path, to=[ANN, address.parse("bob@example.com")], sender_name='Prüfstand "Süd"'))
    assert mail.keys()[:5] == ["Date", "From", "To", "Message-ID", "Subject"]
    assert mail["Date"] == "Mon, 21 Sep 2026 14:13:20 +0000"
    assert [str(one) for one in mail["To"].addresses] == ["ann@example.org", "bob@example.com"]
    assert mail["From"].addresses[0].display_name == 'Prüfstand "Süd"'
    assert mail["From"].addresses[0].addr_spec == "ann@example.org"
    assert mail["Message-ID"] == "<key.1of1@example.org>"
    assert mail.get_content() == "Hello\r\n"
    assert mail.defects == []


def test_lines_are_short_ascii_and_end_as_the_wire_wants_it(tmp_path: Path) -> None:
    attached = tmp_path / "a.bin"
    attached.write_bytes(bytes(range(256)) * 999)
    raw = written(
        tmp_path,
        subject="Fährt " * 30,
        text="line\n.dot\r\n" + "x" * 3000,
        attachment=Attachment(path=attached, start=0, length=attached.stat().st_size, name="a.zip"),
    ).read_bytes()
    assert raw.isascii()
    assert raw.replace(b"\r\n", b"").count(b"\n") == raw.replace(b"\r\n", b"").count(b"\r") == 0
    assert max(len(line) for line in raw.split(b"\r\n")) <= 78
    assert raw.endswith(b"\r\n")


def head(**more: Any) -> tuple[bytes, EmailMessage]:
    """The bytes of a mail before its text, and the mail as Python's parser reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), **more)
        return path.read_bytes().partition(b"\r\n\r\n")[0], read(path)


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(LINE)
def test_any_subject_reads_back_as_it_was(subject: str) -> None:
    raw, mail = head(subject=subject)
    assert max(len(line) for line in raw.split(b"\r\n")) <= 78
    assert mail.keys() == HEADERS
    assert mail["Subject"].strip(" ") == subject.strip(" ")


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(LINE)
def test_any_name_of_a_sender_stays_a_name(name: str) -> None:
    _, mail = head(sender_name=name.strip())
    assert mail.keys() == HEADERS
    assert [one.addr_spec for one in mail["From"].addresses] == ["ann@example.org"]


@pytest.mark.parametrize(
    "text",
    [
        "=?utf-8?q?=41?=",
        "nach 記録 über Prüfstand drive 運転 (1/4) Süd und Österreich",
        "Alarm обгон Fahrt Österreich (1/4) nach über",
        "Ö" * 100,
    ],
)
def test_encoded_words_and_blanks_between_them_are_kept(text: str) -> None:
    raw, mail = head(subject=text, sender_name=text)
    assert mail.keys() == HEADERS
    assert mail["Subject"] == text
    # The newer parser of the library parts encoded words of a name by blanks, which RFC 2047 (6.2) does not.
    assert make_header(decode_header(message_from_bytes(raw)["From"])) == f"{text} <ann@example.org>"
    assert max(len(line) for line in raw.split(b"\r\n")) <= 78
    assert not re.search(rb"\?==\?", raw), "encoded words without a blank between them are none"


@pytest.mark.parametrize(
    "text", ["a\r\nBcc: evil@x", "a\nb", "a\rb", "a\x00", "a\u2028b", "a\u202eb", "a\x85b", "\ud800"]
)
@pytest.mark.parametrize("field", ["subject", "sender_name", "message_id"])
def test_no_line_break_gets_into_a_head(tmp_path: Path, text: str, field: str) -> None:
    assert not compose.is_one_line(text)
    with pytest.raises(ValueError, match="line"):
        written(tmp_path, **{field: text})


@pytest.mark.parametrize(
    "name", ["", "a b.zip", 'a".zip', "a\r\nX: y.zip", "../a.zip", "a/b.zip", ".zip", "ä.zip", "a;b", "x" * 121]
)
def test_no_name_of_a_file_breaks_out(name: str) -> None:
    with pytest.raises(ValueError, match="no name"):
        compose.file_name(name)


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(st.text(max_size=400))
def test_any_text_reads_back_line_by_line(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    if any(0xD800 <= ord(letter) < 0xE000 for letter in text):
        return
    mail = read(written(tmp_path_factory.mktemp("mail"), text=text))
    plain = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n") + "\n"
    assert (mail.get_payload(decode=True) or b"").decode().replace("\r\n", "\n") == plain  # type: ignore[union-attr]


@pytest.mark.parametrize("size", [0, 1, 56, 57, 58, 57 * 4096 - 1, 57 * 4096, 57 * 4096 + 1, 500_000])
def test_what_is_attached_reads_back(tmp_path: Path, size: int) -> None:
    content = hashlib.shake_256(b"x").digest(size + 20)
    source = tmp_path / "source"
    source.write_bytes(content)
    mail = read(written(tmp_path, attachment=Attachment(path=source, start=10, length=size, name="drive.zip.001")))
    assert mail.defects == []
    text, attached = mail.iter_parts()
    assert text.get_content() == "Hello\r\n"
    assert attached.get_filename() == "drive.zip.001"
    assert attached.get_content() == content[10 : 10 + size]


def test_an_address_beyond_ascii_stands_in_its_own_letters(tmp_path: Path) -> None:
    raw = written(tmp_path, to=[ANN, JORG], sender=JORG, sender_name="Jörg").read_bytes()
    assert "To: ann@example.org, jörg@xn--bcher-kva.example\r\n".encode() in raw
    assert "<jörg@xn--bcher-kva.example>\r\n".encode() in raw


def test_a_file_that_shrank_is_no_mail(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(b"short")
    with pytest.raises(OSError, match="shorter"):
        written(tmp_path, attachment=Attachment(path=source, start=0, length=9, name="a.zip"))


def test_a_cancelled_mail_is_not_written_to_its_end(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(b"content")
    stop = threading.Event()
    stop.set()
    with pytest.raises(Stopped):
        compose.write(
            draft(attachment=Attachment(path=source, start=0, length=7, name="a.zip")), tmp_path / "m.eml", stop
        )


def test_a_large_mail_takes_little_memory(tmp_path: Path) -> None:
    source = tmp_path / "source"
    with open(source, "wb") as file:
        file.truncate(40_000_000)
    tracemalloc.start()
    written(tmp_path, attachment=Attachment(path=source, start=0, length=40_000_000, name="a.zip"))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000
