"""One address and nothing else: whatever is taken is one mailbox on the wire; whatever could carry more is refused."""

from __future__ import annotations

import re
from email import message_from_string, policy
from email.utils import getaddresses

import pytest
from aiosmtplib.email import quote_address
from hypothesis import given, settings
from hypothesis import strategies as st

from server.mail import address, compose
from server.mail.address import BadAddress, MailAddress

ATEXT = st.sampled_from("abcxyzABC019#$&'*+/=?^_{}~-äßñ中й")
LABEL = st.from_regex(r"[a-z0-9]([a-z0-9-]{0,10}[a-z0-9])?", fullmatch=True).filter(lambda one: one[2:4] != "--")


@pytest.mark.parametrize(
    ("text", "wire"),
    [
        ("ann@example.org", "ann@example.org"),
        ("Ann.Lee+cars@Example.ORG", "Ann.Lee+cars@example.org"),
        ("root@localhost", "root@localhost"),
        ("o'neil@example.org", "o'neil@example.org"),
        ("ann@bücher.example", "ann@xn--bcher-kva.example"),
        ("ann@例え.jp", "ann@xn--r8jz45g.jp"),
        ("jörg@example.org", "jörg@example.org"),
        ("ann@faß.de", "ann@xn--fa-hia.de"),
        ("ann@xn--bcher-kva.example", "ann@xn--bcher-kva.example"),
        (f"{'a' * 64}@example.org", f"{'a' * 64}@example.org"),
    ],
)
def test_an_address_is_taken_as_it_goes_over_the_wire(text: str, wire: str) -> None:
    assert address.parse(text).text == wire


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ann",
        "@example.org",
        "ann@",
        "a@b, evil@x",
        "a@b,evil@x",
        "a@b;evil@x",
        "a@b evil@x",
        "a@b\r\nBcc: evil@x",
        "a@b\nevil@x",
        "a@b\x00",
        "a@b\u2028evil",
        "a@b\u200b",
        "a\u202e@b",
        "a@ex\u00adample.org",
        " a@b",
        "a@b ",
        "a@@b",
        "a@b@c",
        "Ann <a@b>",
        "<a@b>",
        '"a@b,evil"@x',
        '"a"@example.org',
        "a(comment)@example.org",
        "a@example.org (evil)",
        "a@[127.0.0.1]",
        "a@127.0.0.1",
        "a@b:25",
        "@relay:a@b",
        "a%evil@example.org",
        "evil!a@example.org",
        "|a@example.org",
        "-a@example.org",
        ".a@example.org",
        "a.@example.org",
        "a..b@example.org",
        "a@example..org",
        "a@.example.org",
        "a@example.org.",
        "a@-example.org",
        "a@example-.org",
        "a@exa_mple.org",
        "a@example.org\\",
        "a@exam\uff20ple.org",
        "a\uff20b@example.org",
        "group: a@b;",
        f"{'a' * 65}@example.org",
        f"{'ä' * 33}@example.org",
        f"a@{'b' * 64}.org",
        "a@" + ".".join(["b" * 60] * 5),
        "a\ud800@example.org",
    ],
    ids=ascii,
)
def test_what_is_more_than_one_address_or_none_is_refused(text: str) -> None:
    with pytest.raises(BadAddress) as why:
        address.parse(text)
    assert str(why.value).endswith(".")
    assert str(why.value).isprintable()


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(st.text(max_size=80) | st.builds("{}@{}".format, st.text(max_size=20), st.text(max_size=20)))
def test_whatever_is_taken_is_one_mailbox_for_every_reader(text: str) -> None:
    try:
        one = address.parse(text)
    except BadAddress:
        return
    assert one.text.count("@") == 1
    assert not re.search(r"[\s,;:<>()\[\]\"\\\x00-\x1f\x7f]", one.text)
    assert getaddresses([one.text]) == [("", one.text)]
    assert quote_address(one.text) == f"<{one.text}>"
    assert address.parse(one.text) == one, "taken once, it is taken again as the same"


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(st.lists(ATEXT, min_size=1, max_size=20).map("".join), st.lists(LABEL, min_size=1, max_size=4))
def test_what_is_an_address_is_taken(local: str, labels: list[str]) -> None:
    if local.startswith("-") or labels[-1].isdigit():
        return
    one = address.parse(f"{local}@{'.'.join(labels)}")
    assert one.domain == ".".join(labels)


@settings(deadline=None)  # beside other work a machine stops for longer than any limit
@given(st.lists(st.builds(MailAddress, local=ATEXT, domain=LABEL), min_size=1, max_size=8))
def test_a_line_of_addresses_holds_these_and_no_other(some: list[MailAddress]) -> None:
    sender = address.parse("ann@example.org")
    draft = compose.Draft(
        sender=sender, sender_name="", to=some, subject="", at_ms=0, message_id="<a@example.org>", text=""
    )
    read = message_from_string(bytes(compose.build(draft)).decode(), policy=policy.SMTPUTF8)
    assert [one.addr_spec for one in read["To"].addresses] == [one.text for one in some]
    assert [one.addr_spec for one in read["From"].addresses] == ["ann@example.org"]
    assert read.keys()[:5] == ["Date", "From", "To", "Message-ID", "Subject"]


@pytest.mark.parametrize(
    ("who", "allowed", "is_allowed"),
    [
        ("ann@example.org", [], True),
        ("ann@example.org", ["example.org"], True),
        ("ann@example.org", ["@example.org"], True),
        ("ann@example.org", ["ann@example.org"], True),
        ("bob@example.org", ["ann@example.org"], False),
        ("ann@sub.example.org", ["example.org"], False),
        ("ann@sub.example.org", ["*.example.org"], True),
        ("ann@example.org", ["*.example.org"], False),
        ("ann@evilexample.org", ["example.org", "*.example.org"], False),
        ("ann@example.org.evil.net", ["example.org", "*.example.org"], False),
        ("ann@EXAMPLE.org", ["Example.ORG"], True),
        ("ann@bücher.example", ["bücher.example"], True),
        ("ann@bücher.example", ["xn--bcher-kva.example"], True),
    ],
)
def test_who_may_be_written_to(who: str, allowed: list[str], is_allowed: bool) -> None:
    entries = [address.parse_allowed(one) for one in allowed]
    assert address.is_allowed(address.parse(who), entries) is is_allowed


@pytest.mark.parametrize(
    "entry", ["", "*", "*.", "a b", "a@b, c@d", "example.org\r\n", "*.*.org", "http://x", "1.2.3.4"]
)
def test_what_is_no_entry_of_the_list_is_refused(entry: str) -> None:
    with pytest.raises(BadAddress):
        address.parse_allowed(entry)


def test_several_addresses_are_each_written_to_once() -> None:
    assert [one.text for one in address.parse_all(["a@b.c", "d@e.f", "a@B.C"])] == ["a@b.c", "d@e.f"]
