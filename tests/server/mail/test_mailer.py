"""The mailer against a real SMTP server: sent, refused, held, split, linked, cancelled, sent again; none lost."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import logging
import sqlite3
import zipfile
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

import psutil
import pytest

from server.mail import sender
from server.mail.mail_folder import MailRefused
from server.mail.sender import Sender, pause_s
from server.mail.settings import BadMailSetting, MailSettingsFile
from server.recording.export import Made
from server.recording.mcap.chain import read_head
from tests.server.mail.mailing import START_MS, Clock, Shelf, mailing, order, over, settings, until
from tests.server.mail.post import Post, certificates, posting
from tests.server.recording.made import record


@pytest.fixture
def shelf(tmp_path: Path) -> Shelf:
    one = Shelf(tmp_path / "shelf")
    one.put("drive")
    return one


@pytest.fixture
async def post(tmp_path: Path) -> AsyncIterator[Post]:
    async with posting(tmp_path / "post") as one:
        yield one


@pytest.mark.parametrize("security", ["none", "starttls", "tls"])
async def test_a_drive_is_sent_encrypted_and_logged_in(tmp_path: Path, shelf: Shelf, security: str) -> None:
    ca, cert = certificates(tmp_path)
    moods = {"none": [], "starttls": ["--starttls"], "tls": []}[security]
    secure = security != "none"
    login = ["--user", "car", "--password", "hunter2"] if secure else []
    given = {"user": "car", "password": "hunter2", "ca": ca} if secure else {}
    async with (
        posting(tmp_path / "post", *(["--cert", str(cert)] if secure else []), *moods, *login) as post,
        mailing(tmp_path / "mail", shelf) as mailer,
    ):
        await mailer.change(settings(post.port, security=security, **given))
        letter = await over(
            mailer, (await mailer.order("key-0001", order(to=("ann@example.org", "bob@example.org")))).n
        )
        assert (letter.state, letter.way) == ("sent", "attached")
        (taken,) = post.taken
        assert taken["tls"] is secure
        assert taken["login"] == ("car" if secure else None)
        assert taken["to"] == ["ann@example.org", "bob@example.org"]
        assert taken["message_id"] == letter.mails[0].message_id
        (mail,) = post.mails()
        assert mail["Subject"] == "Drive"
        attached = next(mail.iter_attachments())
        assert hashlib.sha256(attached.get_content()).hexdigest() == letter.sha256
        assert "See alarm 3." in next(mail.iter_parts()).get_content()


async def test_a_server_that_does_not_prove_who_it_is_gets_no_password(
    tmp_path: Path, shelf: Shelf, caplog: pytest.LogCaptureFixture
) -> None:
    _, cert = certificates(tmp_path)
    (tmp_path / "other").mkdir()
    foreign, _ = certificates(tmp_path / "other")
    for security, mood in (("tls", []), ("starttls", ["--starttls"])):
        async with (
            posting(tmp_path / security, "--cert", str(cert), *mood, "--user", "car", "--password", "x") as post,
            mailing(tmp_path / f"mail-{security}", shelf) as mailer,
        ):
            await mailer.change(settings(post.port, security=security, user="car", password="x", ca=foreign))
            letter = await over(mailer, (await mailer.order("key-0001", order())).n)
            assert letter.state == "failed"
            assert "cannot be verified" in letter.detail
            assert post.taken == []


async def test_a_refused_login_fails_all_that_waits_and_new_settings_send_it(
    tmp_path: Path, shelf: Shelf, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    ca, cert = certificates(tmp_path)
    login = ("--cert", str(cert), "--user", "car", "--password", "hunter2")
    async with posting(tmp_path / "post", *login) as post, mailing(tmp_path / "mail", shelf) as mailer:
        given = settings(post.port, security="tls", user="car", password="secret-wrong", ca=ca)
        await mailer.change(given)
        some = [await mailer.order(f"key-000{i}", order()) for i in range(3)]
        for one in some:
            letter = await over(mailer, one.n)
            assert letter.state == "failed"
            assert "refuses the login of car: 535" in letter.detail
            assert "secret-wrong" not in repr(letter)
        await mailer.change({**given, "password": "hunter2"})
        assert [(await over(mailer, one.n)).state for one in some] == ["sent"] * 3
        assert len(post.taken) == 3
    assert "secret-wrong" not in caplog.text
    assert "hunter2" not in caplog.text
    kept = [path for path in tmp_path.rglob("*") if path.is_file() and b"hunter2" in path.read_bytes()]
    assert [path.name for path in kept] == ["settings.toml"], "the password lies in one file"


async def test_a_refused_recipient_is_named_and_the_others_have_it(tmp_path: Path, shelf: Shelf) -> None:
    clock = Clock()
    moods = ("--refuse", "gone@example.org", "--delay", "busy@example.org")
    to = ("ann@example.org", "gone@example.org", "busy@example.org")
    async with posting(tmp_path / "post", *moods) as post, mailing(tmp_path / "mail", shelf, clock) as mailer:
        await mailer.change(settings(post.port))
        n = (await mailer.order("key-0001", order(to=to))).n
        letter = await until(mailer, n, lambda letter: letter.detail != "")
        assert letter.state == "queued", "one of them may take it later"
        assert [one.state for one in letter.mails[0].recipients] == ["accepted", "refused", "waiting"]
        assert letter.detail.startswith("busy@example.org: 450 4.2.0")
        await post.kill()
        await post.start("--refuse", "gone@example.org")
        clock.ms += 10_000
        mailer.look()
        letter = await over(mailer, n)
        assert letter.state == "failed"
        assert (
            letter.detail
            == "gone@example.org: 550 5.1.1 <gone@example.org>: no such mailbox; 2 of 3 recipients have it"
        )
        assert [one["to"] for one in post.taken] == [["ann@example.org"], ["busy@example.org"]], "nobody got it twice"
        assert len({one["message_id"] for one in post.taken}) == 1


async def test_a_mail_refused_for_good_is_not_tried_again(tmp_path: Path, shelf: Shelf) -> None:
    async with posting(tmp_path / "post", "--reject") as post, mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order())).n)
        assert (letter.state, letter.detail) == ("failed", "554 5.6.0 content rejected")
        assert letter.mails[0].attempts == 1
        assert (tmp_path / "mail" / "outbox" / letter.mails[0].file).is_file(), "what failed can be sent again"
        await post.kill()
        await post.start("--seed", "1")
        await mailer.resend(letter.n)
        assert (await over(mailer, letter.n)).state == "sent"
        assert post.taken[0]["message_id"] == letter.mails[0].message_id


async def test_while_the_server_is_down_it_waits_longer_and_longer_and_is_sent_when_it_is_back(
    tmp_path: Path, shelf: Shelf, post: Post
) -> None:
    clock = Clock()
    async with mailing(tmp_path / "mail", shelf, clock) as mailer:
        await mailer.change(settings(post.port))
        await post.kill()
        first = (await mailer.order("key-0001", order())).n
        await until(mailer, first, lambda letter: letter.detail != "")
        second = (await mailer.order("key-0002", order())).n
        waiting = await until(mailer, second, lambda letter: letter.detail != "")
        assert waiting.mails[0].attempts == 0, "it waits with the first"
        for attempts in (1, 2, 3, 4):
            letter = await until(
                mailer, first, lambda letter, a=attempts: letter.mails and letter.mails[0].attempts == a  # type: ignore[misc]
                and letter.state == "queued" and letter.mails[0].next_ms > clock.ms,
            )  # fmt: skip
            assert letter.detail == f"127.0.0.1:{post.port} refuses the connection."
            assert letter.mails[0].next_ms == clock.ms + 1000 * pause_s(attempts)
            if attempts == 4:
                await post.start()  # before the mail is due: it is tried as soon as it is
            clock.ms = letter.mails[0].next_ms or 0
            mailer.look()
        assert (await over(mailer, first)).state == "sent"
        clock.ms += 3_600_000
        mailer.look()
        waited = await over(mailer, second)
        assert waited.state == "sent"
        assert waited.mails[0].attempts <= 5, "one attempt serves all waiting mails"
        assert len(post.taken) == 2
        assert {one["date"] for one in post.taken} == {"Mon, 21 Sep 2026 14:13:20 +0000"}, "the Date of the first try"


async def test_a_temporary_refusal_is_tried_again_under_the_same_name(tmp_path: Path, shelf: Shelf) -> None:
    clock = Clock()
    async with (
        posting(tmp_path / "post", "--temporary", "1") as post,
        mailing(tmp_path / "mail", shelf, clock) as mailer,
    ):
        await mailer.change(settings(post.port))
        n = (await mailer.order("key-0001", order())).n
        letter = await until(mailer, n, lambda letter: letter.detail != "")
        assert (letter.state, letter.detail) == ("queued", "451 4.3.0 try again later")
        await post.kill()
        await post.start("--lost", "1")
        clock.ms += 10_000
        mailer.look()
        letter = await until(mailer, n, lambda letter: "may have arrived" in letter.detail)
        assert letter.state == "queued"
        await post.kill()
        await post.start("--seed", "1")
        clock.ms += 30_000
        mailer.look()
        assert (await over(mailer, n)).state == "sent"
        assert len(post.taken) == 2, "the lost reply made a duplicate"
        assert len({(one["message_id"], one["date"], one["sha256"]) for one in post.taken}) == 1, "which is known"


@pytest.mark.field
@pytest.mark.slow
async def test_a_drive_of_sixty_megabytes_comes_in_parts_that_join(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    content = hashlib.shake_256(b"drive").digest(60_000_000)
    shelf.put("large", content)
    process = psutil.Process()
    slowest = 0.0
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        content = b""
        peak = before = process.memory_info().rss
        n = (await mailer.order("key-0001", order("large"))).n
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(100):
            while (letter := await mailer.letter(n)).state in ("queued", "sending"):
                due = loop.time() + 0.02
                await asyncio.sleep(0.02)
                slowest = max(slowest, loop.time() - due)
                peak = max(peak, process.memory_info().rss)
    print(
        f"60 MB in {len(letter.mails)} mails: {(peak - before) / 1e6:.0f} MB more memory, "
        f"loop late {slowest * 1e3:.0f} ms"
    )
    assert (letter.state, letter.way, len(letter.mails)) == ("sent", "split", 4)
    assert all(mail.size_bytes < 25_000_000 for mail in letter.mails), "what most providers take"
    assert peak - before < 25_000_000, "it is never in memory"
    names = {}
    for mail in post.mails():
        attached = next(mail.iter_attachments())
        names[attached.get_filename()] = attached.get_content()
        assert f"SHA-256 of large.zip: {letter.sha256}" in next(mail.iter_parts()).get_content()
    assert sorted(names) == [f"large.zip.00{i}" for i in (1, 2, 3, 4)]
    joined = tmp_path / "large.zip"
    joined.write_bytes(b"".join(names[name] for name in sorted(names)))
    assert hashlib.sha256(joined.read_bytes()).hexdigest() == letter.sha256
    with zipfile.ZipFile(joined) as archive:
        assert archive.read("large.mcap") == (shelf.folder / "large.mcap").read_bytes()
    assert [mail["Subject"] for mail in post.mails()] == [f"Drive ({i}/4)" for i in (1, 2, 3, 4)]


async def test_what_is_too_large_goes_as_a_link_when_that_was_chosen(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    shelf.put("large", hashlib.shake_256(b"x").digest(250_000))
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port, limit_mb=0.1))
        some = [
            await mailer.order("key-0001", order("large", too_large="link", base="http://192.168.4.1:8000")),
            await mailer.order("key-0002", order("drive", too_large="link", base="http://192.168.4.1:8000")),
            await mailer.order("key-0003", order("large", too_large="link")),
        ]
        large, small, nowhere = [await over(mailer, one.n) for one in some]
        assert (large.way, small.way) == ("link", "attached"), "what fits is attached"
        mails = post.mails()
        assert not list(mails[0].iter_attachments())
        assert "\nhttp://192.168.4.1:8000/api/recordings/large/file.mcap\n" in mails[0].get_content().replace(
            "\r\n", "\n"
        )
        assert (nowhere.state, nowhere.detail) == (
            "failed",
            "No address for links is known: set it in Settings, E-mail.",
        )
        await mailer.change(settings(post.port, limit_mb=0.1, link_base="https://car.example/x"))
        await mailer.resend(nowhere.n)
        assert (await over(mailer, nowhere.n)).state == "sent"
        assert "https://car.example/x/api/recordings/large/file.mcap" in post.mails()[-1].get_content()


@pytest.mark.parametrize(
    ("more", "state", "holds"),
    [
        ({"format": "csv"}, "sent", "drive.zip"),
        ({"format": "html"}, "sent", "drive.zip"),
        ({"format": "bag"}, "failed", "drive cannot be written as bag: its messages have no definition"),
        ({"recordings": ("drive", "other")}, "sent", "drive_and_1_more.zip"),
    ],
)
async def test_formats(
    tmp_path: Path, shelf: Shelf, post: Post, more: dict[str, object], state: str, holds: str
) -> None:
    shelf.put("other")
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order(**more))).n)
        assert letter.state == state
        if state == "failed":
            assert letter.detail == holds
        else:
            assert next(post.mails()[0].iter_attachments()).get_filename() == holds
        assert list((tmp_path / "mail" / "work").iterdir()) == [], "nothing is left lying about"


async def test_a_database_is_not_sent_without_its_log(
    tmp_path: Path, shelf: Shelf, post: Post, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "drive_0.db3"
    path.write_bytes(b"a database")
    path.with_name("drive_0.db3-wal").write_bytes(b"most of the drive")
    monkeypatch.setattr(shelf, "path_of", lambda recording: path)
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order())).n)
        assert (letter.state, post.mails()) == ("failed", [])
        assert letter.detail == "drive is a database with a log that holds a part of it: send it in another format."
        assert (await over(mailer, (await mailer.order("key-0002", order(format="csv"))).n)).state == "sent"


async def test_mails_of_reports_quote_the_head_of_the_chain(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    head = read_head(record(shelf.folder / "chained.mcap", seconds=1.0), "chained")
    assert head is not None
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        for number, format in enumerate(("html", "mcap"), 1):
            ordered = await mailer.order(f"key-000{number}", order("chained", "drive", format=format))
            assert (await over(mailer, ordered.n)).state == "sent"
    report, file = (next(mail.iter_parts()).get_content().replace("\r\n", "\n") for mail in post.mails())
    assert f"Head of the hash chain of each recording:\nchained: {head.digest}\ndrive: not known\n" in report
    assert "hash chain" not in file


async def test_a_drive_is_in_one_page_whichever_of_its_parts_are_ordered(
    tmp_path: Path, shelf: Shelf, post: Post
) -> None:
    for name in ("drive_p2", "other"):
        shelf.put(name)
    shelf.drives = [["drive", "drive_p2"]]
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        for number, format in enumerate(("html", "csv"), 1):
            ordered = await mailer.order(f"key-000{number}", order("drive_p2", "drive", "other", format=format))
            assert (await over(mailer, ordered.n)).state == "sent"
    report, table = (next(mail.iter_parts()).get_content().replace("\r\n", "\n") for mail in post.mails())
    assert shelf.exported == [["drive", "drive_p2"], ["other"], ["drive_p2"], ["drive"], ["other"]]
    assert "recording:\ndrive: not known\ndrive_p2: not known\nother: not known\n" in report
    assert "not known" not in table


async def test_what_is_made_can_be_cancelled(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    begun, ended = asyncio.Event(), asyncio.Event()

    class Slow(Shelf):
        async def export(
            self, paths: Sequence[Path], format: str, into: Path, progress: Callable[[float], None], *, required: Path
        ) -> Made:
            progress(0.5)
            begun.set()
            try:
                await asyncio.Event().wait()
            finally:
                ended.set()
            raise AssertionError

    async with mailing(tmp_path / "mail", Slow(shelf.folder)) as mailer:
        await mailer.change(settings(post.port))
        letter = await mailer.order("key-0001", order(format="csv"))
        await begun.wait()
        assert mailer.share_of(letter) == 0.3
        assert (await mailer.cancel(letter.n)).state == "cancelled"
        assert ended.is_set(), "the export was cancelled"
        following = await mailer.order("key-0002", order())
        assert (await over(mailer, following.n)).state == "sent"
        with pytest.raises(MailRefused, match="already cancelled"):
            await mailer.cancel(letter.n)


async def test_what_is_on_its_way_can_be_cancelled_and_is_not_taken(tmp_path: Path, shelf: Shelf) -> None:
    """A server that stops reading in the midst of a mail."""
    stuck = asyncio.Event()

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"220 mail.test\r\n")
        while line := await reader.readline():
            if line.startswith(b"DATA"):
                writer.write(b"354 go on\r\n")
                stuck.set()
                try:
                    await asyncio.Event().wait()
                finally:
                    writer.transport.abort()
            writer.write(b"250 OK\r\n")

    talking: list[asyncio.Task[None]] = []
    server = await asyncio.start_server(
        lambda r, w: talking.append(asyncio.ensure_future(talk(r, w))), "127.0.0.1", 0, limit=1 << 12
    )
    shelf.put("large", hashlib.shake_256(b"x").digest(9_000_000))
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(server.sockets[0].getsockname()[1]))
        letter = await mailer.order("key-0001", order("large"))
        await stuck.wait()
        await until(mailer, letter.n, lambda letter: letter.state == "sending")
        assert (await mailer.cancel(letter.n)).state == "cancelled"
        assert list((tmp_path / "mail" / "outbox").iterdir()) == []
    for task in talking:
        task.cancel()
    await asyncio.gather(*talking, return_exceptions=True)
    server.close()


async def test_a_refusal_in_the_midst_of_a_mail_is_heard(tmp_path: Path, shelf: Shelf) -> None:
    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"220 mail.test\r\n")
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                if line.startswith(b"DATA"):
                    writer.write(b"354 go on\r\n")
                    await reader.readexactly(100_000)
                    writer.write(b"552 5.3.4 too much\r\n")
                    await writer.drain()
                    while await reader.read(1 << 16):
                        pass
                    break
                writer.write(b"250 OK\r\n")
            writer.close()

    server = await asyncio.start_server(talk, "127.0.0.1", 0)
    shelf.put("large", hashlib.shake_256(b"x").digest(9_000_000))
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(server.sockets[0].getsockname()[1]))
        letter = await over(mailer, (await mailer.order("key-0001", order("large"))).n)
        assert (letter.state, letter.detail) == ("failed", "552 5.3.4 too much")
    server.close()


async def test_a_mail_larger_than_the_server_takes_is_not_even_begun(tmp_path: Path, shelf: Shelf) -> None:
    shelf.put("large", hashlib.shake_256(b"x").digest(300_000))
    async with posting(tmp_path / "post", "--size", "100000") as post, mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order("large"))).n)
        assert letter.state == "failed"
        assert "takes mails of at most 0.1 MB, and this one has 0.4 MB: lower the size limit" in letter.detail


@pytest.mark.parametrize("is_ascii", [False, True])
async def test_an_address_beyond_ascii_needs_a_server_that_takes_it(
    tmp_path: Path, shelf: Shelf, is_ascii: bool
) -> None:
    async with (
        posting(tmp_path / "post", *(["--ascii"] if is_ascii else [])) as post,
        mailing(tmp_path / "mail", shelf) as mailer,
    ):
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order(to=("jörg@xn--bcher-kva.example",)))).n)
        if is_ascii:
            assert letter.state == "failed"
            assert "beyond ASCII" in letter.detail
        else:
            assert letter.state == "sent"
            assert post.taken[0]["to"] == ["jörg@xn--bcher-kva.example"]


async def test_lines_that_begin_with_a_dot_arrive_as_they_were(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        await post.kill()
        letter = await mailer.order("key-0001", order())
        letter = await until(mailer, letter.n, lambda letter: letter.detail != "")
        path = tmp_path / "mail" / "outbox" / letter.mails[0].file
        # Across the places where the file is read piece by piece too.
        content = (
            b"Subject: dots\r\n\r\n.\r\n..a\r\n"
            + b"x" * 26
            + (b"x" * 62 + b"\r\n") * 4094
            + b"x" * 75
            + b"\r\n.b\r\n."
            + b"\r\n"
        )
        assert content[2**18 :].startswith(b".b")
        path.write_bytes(content)
        await post.start()
        await mailer.resend(letter.n)
        await over(mailer, letter.n)
        assert (post.folder / post.taken[0]["file"]).read_bytes().endswith(b"\r\n.b\r\n.\r\n")
        assert (post.folder / post.taken[0]["file"]).read_bytes().count(b"\r\n.\r\n..a\r\n") == 1


async def test_who_is_not_allowed_gets_nothing_even_when_it_waits_already(
    tmp_path: Path, shelf: Shelf, post: Post
) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port, allowed=["example.org"]))
        with pytest.raises(MailRefused, match=r"evil@example\.com is not among the allowed recipients") as why:
            await mailer.order("key-0001", order(to=("ann@example.org", "evil@example.com")))
        assert why.value.field == "to"
        await post.kill()
        n = (await mailer.order("key-0002", order())).n
        await until(mailer, n, lambda letter: letter.detail != "")
        await post.start()
        await mailer.change(settings(post.port, allowed=["example.com"]))
        letter = await over(mailer, n)
        assert (letter.state, letter.detail) == ("failed", "ann@example.org is not among the allowed recipients.")
        assert post.taken == []
        with pytest.raises(MailRefused):
            await mailer.resend(n)


async def test_what_cannot_be_ordered_is_refused_with_a_reason(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        with pytest.raises(MailRefused, match="not set up"):
            await mailer.order("key-0001", order())
        await mailer.change(settings(post.port))
        with pytest.raises(MailRefused, match="no finished recording nothing"):
            await mailer.order("key-0001", order("nothing"))
        with pytest.raises(BadMailSetting):
            await mailer.change(settings(0))
        for request in (mailer.cancel(9), mailer.resend(9), mailer.letter(9)):
            with pytest.raises(MailRefused, match="no mail number 9"):
                await request


async def test_a_recording_that_is_gone_is_told(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        await post.kill()
        n = (await mailer.order("key-0001", order())).n
        await until(mailer, n, lambda letter: letter.detail != "")
        (tmp_path / "shelf" / "drive.mcap").unlink()
        await post.start()
        await mailer.resend(n)
        assert (await over(mailer, n)).state == "sent", "it was made before"
        await mailer.resend(n)
        assert (await over(mailer, n)).detail == "The recording drive no longer exists."


async def test_it_goes_on_after_a_restart(tmp_path: Path, shelf: Shelf, post: Post) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        await post.kill()
        n = (await mailer.order("key-0001", order())).n
        first = await until(mailer, n, lambda letter: letter.detail != "")
    await post.start()
    clock = Clock()
    clock.ms = START_MS + 60_000
    async with mailing(tmp_path / "mail", shelf, clock) as mailer:
        letter = await over(mailer, n)
        assert letter.state == "sent"
        assert letter.mails[0].message_id == first.mails[0].message_id


async def test_one_server_sends_from_a_folder(tmp_path: Path, shelf: Shelf) -> None:
    async with mailing(tmp_path / "mail", shelf), mailing(tmp_path / "mail", shelf) as second:
        assert second.trouble == "Mail is off: another catgraph sends from the same folder."
        with pytest.raises(MailRefused) as why:
            await second.order("key-0001", order())
        assert why.value.status == 409
        with pytest.raises(MailRefused) as why:
            await second.letters(None, 10)
        assert why.value.status == 503


async def test_a_disk_that_takes_nothing_is_told_and_what_was_sent_is_not_sent_again(
    tmp_path: Path, shelf: Shelf, post: Post, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sender, "AGAIN_S", 0.05)
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        outbox = mailer._folder._outbox
        assert outbox is not None
        n = (await mailer.order("key-0001", order())).n
        await until(mailer, n, lambda letter: letter.is_ready)
        await over(mailer, n)
        # Another program that holds the file refuses every change, as a full disk does.
        outbox._database.execute("PRAGMA busy_timeout = 0")
        n = (await mailer.order("key-0002", order())).n
        await until(mailer, n, lambda letter: letter.state == "sending" or letter.state == "sent")
        holder = sqlite3.connect(tmp_path / "mail" / "outbox.sqlite", isolation_level=None)
        holder.execute("BEGIN IMMEDIATE")
        with pytest.raises(MailRefused, match="The outbox is not kept") as why:
            await mailer.order("key-0003", order())
        assert why.value.status == 507
        async with asyncio.timeout(10):
            while len(post.taken) < 2:
                await asyncio.sleep(0.01)
        holder.execute("ROLLBACK")
        holder.close()
        assert (await over(mailer, n)).state == "sent"
        assert mailer.trouble is None
        assert len(post.taken) == 2, "what was taken is not sent again"


async def test_a_task_that_fails_is_begun_again(
    tmp_path: Path, shelf: Shelf, post: Post, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(sender, "AGAIN_S", 0.01)
    failures = iter([RuntimeError("a fault"), RuntimeError("another")])
    whole = Sender._send

    async def failing(self: Sender, *given: object) -> object:
        for fault in failures:
            raise fault
        return await whole(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(Sender, "_send", failing)
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        assert (await over(mailer, (await mailer.order("key-0001", order())).n)).state == "sent"
    assert "task failed, restarting: task=sending mail" in caplog.text


async def test_a_mail_whose_sending_broke_in_the_midst_is_sent_all_the_same(
    tmp_path: Path, shelf: Shelf, post: Post, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sender, "AGAIN_S", 0.01)
    faults = iter([RuntimeError("a fault")])
    whole = Sender._finish

    async def failing(self: Sender, *given: object) -> object:
        for fault in faults:
            raise fault
        return await whole(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(Sender, "_finish", failing)
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        letter = await over(mailer, (await mailer.order("key-0001", order())).n)
        assert (letter.state, letter.mails[0].attempts) == ("sent", 2)


async def test_what_was_ordered_before_the_settings_were_emptied_says_so(
    tmp_path: Path, shelf: Shelf, post: Post
) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        await post.kill()
        n = (await mailer.order("key-0001", order())).n
        await until(mailer, n, lambda letter: letter.detail != "")
        await mailer.change({})
        letter = await over(mailer, n)
        assert letter.state == "failed"
        assert letter.detail == "Mail is not set up: enter SMTP host and sender in Settings, E-mail."


async def test_link_local_and_metadata_addresses_are_never_dialled(tmp_path: Path, shelf: Shelf) -> None:
    async with mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change({**settings(25), "host": "169.254.169.254"})
        letter = await over(mailer, (await mailer.order("key-0001", order())).n)
        assert (letter.state, letter.detail) == ("failed", "169.254.169.254 is never dialled.")


async def test_settings_that_were_damaged_are_told(tmp_path: Path, shelf: Shelf) -> None:
    (tmp_path / "mail").mkdir()
    (tmp_path / "mail" / "settings.toml").write_text("host = ")
    async with mailing(tmp_path / "mail", shelf) as mailer:
        assert mailer.complaints[0].endswith("set them again.")
        assert not mailer.settings.is_complete
    assert MailSettingsFile(tmp_path / "mail" / "settings.toml").read().host == ""
