"""The outbox: what is ordered is on the disk, moves from state to state, survives what it must, forgets what it may."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.mail import outbox as outbox_module
from server.mail.order import Composed, Letter, Outcome, Prepared, Recipient
from server.mail.outbox import Outbox, OutboxFull, WrongState
from tests.server.mail.mailing import START_MS as T
from tests.server.mail.mailing import order

HOUR_MS = 3_600_000


@pytest.fixture
def outbox(tmp_path: Path) -> Iterator[Outbox]:
    one = Outbox(tmp_path)
    yield one
    one.close()


def composed(outbox: Outbox, key: str = "key", parts: int = 1, sum_: str = "aa") -> Prepared:
    """The mails of a letter, on the disk."""
    mails = []
    for part in range(1, parts + 1):
        name = f"{key}-{part}.eml"
        (outbox.files / name).write_text("mail")
        mails.append(
            Composed(part=part, parts=parts, message_id=f"<{key}.{sum_}.{part}of{parts}@x>", file=name, size_bytes=4)
        )
    return Prepared(mails=tuple(mails), sender="a@b", way="attached", size_bytes=4, sha256=sum_)


def ready(outbox: Outbox, key: str = "key", parts: int = 1, to: tuple[str, ...] = ("ann@example.org",)) -> int:
    n = outbox.add(key, order(to=to), T).n
    assert outbox.prepared(n, composed(outbox, key, parts))
    return n


def found_by(outbox: Outbox, n: int) -> Letter:
    letter = outbox.letter(n)
    assert letter is not None
    return letter


def send(outbox: Outbox, outcome: Outcome, now_ms: int = T) -> int:
    """An attempt of the mail that is due."""
    mail = outbox.queue.next_due(now_ms, HOUR_MS)
    assert mail is not None
    assert outbox.queue.begin(mail.n) is not None
    outbox.queue.settle(mail.n, outcome, now_ms)
    return mail.n


def sent(*addresses: str) -> Outcome:
    some = addresses or ("ann@example.org",)
    return Outcome(
        state="sent",
        detail="250 OK",
        recipients=tuple(Recipient(address=a, state="accepted", detail="250") for a in some),
    )


def failed(detail: str = "554 no", of_account: bool = False) -> Outcome:
    return Outcome(state="failed", detail=detail, recipients=(), of_account=of_account)


def later(next_ms: int) -> Outcome:
    return Outcome(state="queued", detail="451 later", recipients=(), next_ms=next_ms)


def test_it_is_durable(outbox: Outbox, tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "outbox.sqlite") as other:
        assert other.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert outbox._database.execute("PRAGMA synchronous").fetchone()[0] == 2, "FULL"


def test_a_letter_goes_from_ordered_to_sent(outbox: Outbox) -> None:
    letter = outbox.add("key", order(text="Grüße"), T)
    assert (letter.state, letter.is_ready, letter.order.text) == ("queued", False, "Grüße")
    assert outbox.queue.next_due(T, HOUR_MS) is None, "it is not made yet"
    waiting = outbox.to_prepare()
    assert waiting is not None
    assert waiting.n == letter.n
    outbox.prepared(letter.n, composed(outbox))
    assert outbox.to_prepare() is None
    mail = outbox.queue.next_due(T, HOUR_MS)
    assert mail is not None
    assert outbox.queue.begin(mail.n) is not None
    assert outbox.letters()[0].state == "sending"
    assert outbox.queue.begin(mail.n) is None, "it is on its way already"
    outbox.queue.settle(mail.n, sent(), T)
    done = outbox.letters()[0]
    assert (done.state, done.detail) == ("sent", "250 OK")
    assert done.mails[0].recipients[0].state == "accepted"
    assert list(outbox.files.iterdir()) == [], "what was sent takes no room"


def test_the_same_key_is_the_same_order(outbox: Outbox) -> None:
    first = outbox.add("key", order(subject="A"), T)
    assert outbox.add("key", order(subject="B"), T + 5) == first
    assert len(outbox.letters()) == 1


def test_what_is_tried_later_waits_and_a_clock_set_back_does_not_hold_it(outbox: Outbox) -> None:
    ready(outbox)
    send(outbox, later(T + 30_000))
    assert outbox.queue.next_due(T + 29_999, HOUR_MS) is None
    assert outbox.queue.earliest_ms() == T + 30_000
    assert outbox.queue.next_due(T + 30_000, HOUR_MS) is not None
    assert outbox.queue.next_due(T - 100 * HOUR_MS, HOUR_MS) is not None, "no pause is so long: the clock was set back"


def test_after_a_kill_what_was_on_its_way_waits_again(tmp_path: Path) -> None:
    first = Outbox(tmp_path)
    n = ready(first)
    mail = first.queue.next_due(T, HOUR_MS)
    assert mail is not None
    first.queue.begin(mail.n)
    first._database.close()  # as a kill leaves it
    again = Outbox(tmp_path)
    again.recover()
    letter = again.letter(n)
    assert letter is not None
    assert letter.state == "queued"
    assert "may arrive twice" in letter.detail
    same = again.queue.next_due(T, HOUR_MS)
    assert same is not None
    assert (same.message_id, same.attempts) == (mail.message_id, 1)
    assert (again.files / same.file).is_file()
    again.close()


def test_after_a_kill_files_that_no_mail_needs_are_gone(tmp_path: Path) -> None:
    first = Outbox(tmp_path)
    ready(first)
    (first.files / "left.eml.new").write_text("half a mail")
    first.close()
    again = Outbox(tmp_path)
    again.recover()
    assert [path.name for path in again.files.iterdir()] == ["key-1.eml"]
    again.close()


def test_a_cancelled_letter_is_not_sent_after_a_kill_either(tmp_path: Path) -> None:
    first = Outbox(tmp_path)
    n = ready(first)
    mail = first.queue.next_due(T, HOUR_MS)
    assert mail is not None
    first.queue.begin(mail.n)
    assert first.cancel(n).state == "sending", "it is on its way until it is broken off"
    first._database.close()
    again = Outbox(tmp_path)
    again.recover()
    letter = again.letter(n)
    assert letter is not None
    assert letter.state == "cancelled"
    assert again.queue.next_due(T, HOUR_MS) is None
    again.close()


@pytest.mark.parametrize(
    ("outcomes", "state", "detail"),
    [
        ([sent(), sent()], "sent", "Part 1 of 2: 250 OK"),
        ([sent(), failed()], "failed", "Part 2 of 2: 554 no"),
        ([failed(), later(T + 9)], "queued", "Part 2 of 2: 451 later"),
        ([sent()], "queued", ""),
    ],
    ids=["both", "one failed", "one waits", "one not tried"],
)
def test_the_state_of_a_letter_of_two_parts(outbox: Outbox, outcomes: list[Outcome], state: str, detail: str) -> None:
    n = ready(outbox, parts=2)
    for outcome in outcomes:
        send(outbox, outcome)
    letter = outbox.letter(n)
    assert letter is not None
    assert (letter.state, letter.detail) == (state, detail)


def test_cancelling_ends_what_waits_and_keeps_what_was_sent(outbox: Outbox) -> None:
    n = ready(outbox, parts=2)
    send(outbox, sent())
    letter = outbox.cancel(n)
    assert (letter.state, letter.detail) == ("cancelled", "1 of 2 mails were sent before.")
    assert outbox.queue.next_due(T, HOUR_MS) is None
    assert list(outbox.files.iterdir()) == []
    with pytest.raises(WrongState, match="already cancelled"):
        outbox.cancel(n)


def test_a_letter_cancelled_while_it_is_made_is_not_sent(outbox: Outbox) -> None:
    n = outbox.add("key", order(), T).n
    outbox.cancel(n)
    assert not outbox.prepared(n, composed(outbox))
    outbox.discard("key")
    assert outbox.queue.next_due(T, HOUR_MS) is None
    assert list(outbox.files.iterdir()) == []


def test_a_mail_that_arrived_though_its_letter_was_cancelled_is_told_as_sent(outbox: Outbox) -> None:
    n = ready(outbox)
    mail = outbox.queue.next_due(T, HOUR_MS)
    assert mail is not None
    outbox.queue.begin(mail.n)
    outbox.cancel(n)
    outbox.queue.settle(mail.n, sent(), T)
    letter = outbox.letter(n)
    assert letter is not None
    assert (letter.state, letter.detail, letter.mails[0].state) == (
        "sent",
        "It was sent before it could be cancelled.",
        "sent",
    )


def test_resending_tries_only_what_has_not_arrived(outbox: Outbox) -> None:
    both = ("ann@example.org", "bob@example.org")
    n = ready(outbox, parts=2, to=both)
    send(outbox, sent(*both))
    refused = (
        Recipient(address=both[0], state="accepted", detail="250"),
        Recipient(address=both[1], state="refused", detail="550"),
    )
    second = send(outbox, Outcome(state="failed", detail="550", recipients=refused))
    letter = outbox.resend(n, "a@b", T + 5)
    assert (letter.state, letter.is_ready) == ("queued", True)
    mail = outbox.queue.next_due(T + 5, HOUR_MS)
    assert mail is not None
    assert (mail.n, mail.attempts) == (second, 0)
    assert [one.state for one in mail.recipients] == ["accepted", "waiting"]


def test_resending_what_was_sent_makes_the_same_mails_again(outbox: Outbox) -> None:
    n = ready(outbox, parts=2)
    ids = [mail.message_id for mail in found_by(outbox, n).mails]
    send(outbox, sent())
    send(outbox, sent())
    assert outbox.resend(n, "a@b", T).is_ready is False, "its files are gone"
    outbox.prepared(n, composed(outbox, parts=2))
    found = [outbox.queue.next_due(T, HOUR_MS)]
    send(outbox, sent())
    found.append(outbox.queue.next_due(T, HOUR_MS))
    assert [mail.message_id for mail in found if mail] == ids
    assert all(one.state == "waiting" for mail in found if mail for one in mail.recipients)


def test_parts_of_another_content_are_all_sent_anew(outbox: Outbox) -> None:
    n = ready(outbox, parts=2)
    send(outbox, sent())
    send(outbox, failed())
    (outbox.files / "key-2.eml").unlink()
    assert outbox.resend(n, "a@b", T).is_ready is False
    outbox.prepared(n, composed(outbox, parts=3, sum_="bb"))
    letter = outbox.letter(n)
    assert letter is not None
    assert [(mail.state, mail.part, mail.parts) for mail in letter.mails] == [("queued", i, 3) for i in (1, 2, 3)]


def test_a_part_that_arrived_is_not_sent_again_when_the_rest_is_made_anew(outbox: Outbox) -> None:
    n = ready(outbox, parts=2)
    send(outbox, sent())
    send(outbox, failed())
    (outbox.files / "key-2.eml").unlink()
    outbox.resend(n, "a@b", T)
    outbox.prepared(n, composed(outbox, parts=2))
    outbox.discard("key")
    letter = outbox.letter(n)
    assert letter is not None
    assert [mail.state for mail in letter.mails] == ["sent", "queued"]
    assert [path.name for path in outbox.files.iterdir()] == ["key-2.eml"]


def test_what_is_on_its_way_is_not_resent(outbox: Outbox) -> None:
    n = outbox.add("key", order(), T).n
    with pytest.raises(WrongState):
        outbox.resend(n, "a@b", T)
    outbox.prepared(n, composed(outbox))
    mail = outbox.queue.next_due(T, HOUR_MS)
    assert mail is not None
    outbox.queue.begin(mail.n)
    with pytest.raises(WrongState):
        outbox.resend(n, "a@b", T)
    with pytest.raises(KeyError):
        outbox.resend(99, "a@b", T)


def test_a_server_that_takes_nothing_holds_or_fails_all_that_waits(outbox: Outbox) -> None:
    first, second = ready(outbox, "one"), ready(outbox, "two")
    outbox.queue.hold("no answer", T + 10_000, HOUR_MS)
    assert outbox.queue.next_due(T, HOUR_MS) is None
    outbox.queue.refuse_all("535 login refused", T)
    assert [letter.state for letter in outbox.letters()] == ["failed", "failed"]
    outbox.queue.try_all_again("a@b", T)
    assert [letter.state for letter in outbox.letters()] == ["queued", "queued"]
    assert outbox.queue.next_due(T, HOUR_MS) is not None
    assert first != second


def test_new_settings_do_not_resend_what_was_refused_for_itself(outbox: Outbox) -> None:
    n = ready(outbox)
    send(outbox, failed())
    outbox.queue.try_all_again("a@b", T)
    assert found_by(outbox, n).state == "failed"


def test_what_waits_is_made_anew_for_another_sender(outbox: Outbox) -> None:
    n = ready(outbox)
    outbox.queue.try_all_again("new@b", T)
    waiting = outbox.to_prepare()
    assert waiting is not None
    assert waiting.n == n


def test_old_letters_are_forgotten_but_none_that_failed_or_waits(
    outbox: Outbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox_module, "KEEP", 3)
    kept = [ready(outbox, "failed"), 0]
    send(outbox, failed())
    kept[1] = outbox.add("making", order(), T).n
    for i in range(6):
        ready(outbox, f"sent-{i}")
        send(outbox, sent())
    outbox.add("last", order(), T)
    letters = outbox.letters()
    assert [letter.key for letter in letters] == ["last", "sent-5", "sent-4", "sent-3", "making", "failed"]
    assert outbox._database.execute("SELECT COUNT(*) FROM mail").fetchone()[0] == 4, "its mails go with a letter"


def test_a_full_outbox_takes_no_more(outbox: Outbox, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outbox_module, "MAX_OPEN", 2)
    outbox.add("one", order(), T)
    ready(outbox, "two")
    with pytest.raises(OutboxFull):
        outbox.add("three", order(), T)
    assert outbox.add("one", order(), T).key == "one", "what is in it is still found"
    outbox.cancel(outbox.letters()[0].n)
    outbox.add("three", order(), T)


def test_the_list_goes_back_page_by_page(outbox: Outbox) -> None:
    for i in range(5):
        outbox.add(f"key-{i}", order(), T)
    first = outbox.letters(None, 2)
    assert [letter.n for letter in first] == [5, 4]
    assert [letter.n for letter in outbox.letters(first[-1].n, 9)] == [3, 2, 1]


@pytest.mark.parametrize(
    "damage", [b"no database at all, but long enough to be one " * 30, b""], ids=["damaged", "empty"]
)
def test_a_damaged_outbox_is_set_aside_with_its_mails(tmp_path: Path, damage: bytes) -> None:
    first = Outbox(tmp_path)
    ready(first)
    first.close()
    for left in tmp_path.glob("outbox.sqlite-*"):
        left.unlink()
    (tmp_path / "outbox.sqlite").write_bytes(damage)
    again = Outbox(tmp_path)
    if damage:
        assert again.complaint is not None
        assert "damaged-1, 1 composed mail lies there too." in again.complaint
        assert {path.name for path in (tmp_path / "damaged-1").iterdir()} == {"outbox.sqlite", "key-1.eml"}
        assert (tmp_path / "damaged-1" / "outbox.sqlite").read_bytes() == damage
    assert again.letters() == []
    again.add("key", order(), T)
    again.close()


def test_a_transaction_is_whole_or_not_at_all(outbox: Outbox) -> None:
    n = outbox.add("key", order(), T).n
    made = composed(outbox, parts=2)
    broken = Prepared(
        mails=(made.mails[0], made.mails[0]), sender="a@b", way="split", size_bytes=4, sha256="aa"
    )  # the same part twice
    with pytest.raises(sqlite3.IntegrityError):
        outbox.prepared(n, broken)
    assert found_by(outbox, n).mails == ()
    assert outbox.prepared(n, made)
