"""Strict parsing of one mail address, and the list of allowed recipients.

Accepted is a Mailbox of RFC 5321 without quoted local parts and address literals, in all scripts (RFC 6531). A domain
is stored as transmitted: ASCII, by IDNA 2008.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import idna

LONGEST = 254  # octets of an address, RFC 5321 4.5.3.1.3 less its brackets
_LONGEST_LOCAL = 64  # octets, 4.5.3.1.1
# The letters of an atom (RFC 5322 3.2.3) without % ! | and `: once the signs of routes and of pipes to programs.
_ATOM_SIGNS = frozenset("#$&'*+/=?^_{}~-")
_LABEL = r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?"
_DOMAIN = re.compile(rf"(?=.{{1,253}}\Z){_LABEL}(\.{_LABEL})*")


class BadAddress(ValueError):
    """The text is no acceptable address; `str()` is one sentence for the operator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MailAddress:
    """One mailbox."""

    local: str
    domain: str  # ASCII, lower case

    @property
    def text(self) -> str:
        """The address as transmitted."""
        return f"{self.local}@{self.domain}"

    @property
    def shown(self) -> str:
        """The address for display: the domain in its own script."""
        return f"{self.local}@{shown_domain(self.domain)}"

    @property
    def needs_utf8(self) -> bool:
        """Whether the server must support SMTPUTF8 (RFC 6531)."""
        return not self.local.isascii()


def parse(text: str) -> MailAddress:
    """The one address in `text`. Raises BadAddress for anything else: none, two, a name beside it, quotes, controls."""
    shown = _seen(text)
    if not text:
        raise BadAddress("No address is given.")
    if len(text) > LONGEST or not text.isprintable() or any(letter.isspace() for letter in text):
        raise BadAddress(f"“{shown}” is not one address: it is too long or holds blanks or invisible characters.")
    if text.count("@") != 1:
        raise BadAddress(f"“{shown}” is not one address, such as name@example.org.")
    local, _, domain = unicodedata.normalize("NFC", text).partition("@")
    if not _is_local(local):
        raise BadAddress(f"“{shown}” is not an address: before the @ it may have letters, digits, . _ + and -.")
    address = MailAddress(local=local, domain=parse_domain(domain))
    if len(address.text.encode()) > LONGEST:
        raise BadAddress(f"“{shown}” is too long for an address.")
    return address


def parse_domain(text: str) -> str:
    """A domain as transmitted. Raises BadAddress."""
    try:
        domain = idna.encode(text, uts46=True, std3_rules=True).decode("ascii").lower()
    except (idna.IDNAError, UnicodeError):
        domain = ""
    if not text.isprintable() or not _DOMAIN.fullmatch(domain) or domain.rpartition(".")[2].isdigit():
        raise BadAddress(f"“{_seen(text)}” is not a domain, such as example.org.")
    return domain


def shown_domain(domain: str) -> str:
    """A domain in its own script, where it has one."""
    try:
        return idna.decode(domain)
    except (idna.IDNAError, UnicodeError):
        return domain


def parse_all(texts: Iterable[str]) -> list[MailAddress]:
    """Several addresses, each once. Raises BadAddress."""
    return list(dict.fromkeys(parse(text) for text in texts))


def parse_allowed(text: str) -> str:
    """An entry of the list of allowed recipients: an address, `example.org`, or `*.example.org` for all below it.

    Raises BadAddress.
    """
    if "@" in text.removeprefix("@"):
        return parse(text).text
    bare = text.removeprefix("@")
    if bare.startswith("*."):
        return f"*.{parse_domain(bare[2:])}"
    return parse_domain(bare)


def is_allowed(address: MailAddress, allowed: Sequence[str]) -> bool:
    """Whether mail may be sent to `address`; an empty list allows every address."""
    if not allowed:
        return True
    return any(
        address.text == one or address.domain == one or (one.startswith("*.") and address.domain.endswith(one[1:]))
        for one in allowed
    )


def _is_local(text: str) -> bool:
    if not 0 < len(text.encode(errors="replace")) <= _LONGEST_LOCAL or text.startswith("-"):
        return False  # a leading - is an option to programs that take addresses as arguments
    return all(atom and all(map(_is_of_atom, atom)) for atom in text.split("."))


def _is_of_atom(letter: str) -> bool:
    if letter.isascii():
        return letter.isalnum() or letter in _ATOM_SIGNS
    return unicodedata.category(letter)[0] in "LMN"


def _seen(text: str) -> str:
    """A text, cut and without control characters, as a message may repeat it."""
    return "".join(letter if letter.isprintable() else "?" for letter in text[:60])
