"""The start-up text of the terminal: addresses, how to pair a phone, and the fingerprint of the authority.

The first line is for scripts too: `catgraph listens on URL`.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

import segno

from server.app.config import Config, default_data
from server.tls.setup import SetupAddresses

_WHITE_ON_BLACK, _AS_BEFORE = "\x1b[97;40m", "\x1b[0m"  # the blocks are the light modules
WITHOUT_HTTPS = (
    "Without HTTPS a phone's browser gives this page no position, does not keep the screen awake, installs nothing for",
    "when the server is away, neither shares files nor copies text; and anyone on the network can eavesdrop.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairing:
    """What lets the next phone in."""

    token: str
    pin: str
    minutes: int
    command: str = "catgraph pair"  # what makes the next invitation


@dataclass(frozen=True, slots=True, kw_only=True)
class Announcement:
    """The contents of the start-up text."""

    config: Config
    url: str  # of the page, with a slash at its end
    others: tuple[str, ...] = ()  # further addresses of the page
    setup: str | None = None  # the plain page that explains
    fingerprint: str | None = None  # of our own authority
    authority: str | None = None
    left_out: tuple[str, ...] = ()  # addresses and names that our certificate cannot cover
    warning: str | None = None
    pairing: Pairing | None = None


def lines(announcement: Announcement, *, draws: bool) -> Iterator[str]:
    """Line by line; `draws`: with QR codes, for a person before a terminal."""
    config = announcement.config
    yield f"catgraph listens on {announcement.url}"
    for vehicle in config.vehicles:
        yield f"  {vehicle.name}: {vehicle.address or 'no address yet, set on the page'}"
    if config.is_open:
        yield "  Only this machine can open it; for phones use --host 0.0.0.0."
    if announcement.others and not config.is_open:
        yield f"  Also: {'  '.join(announcement.others)}"
    if announcement.warning:
        yield f"  Warning: {announcement.warning}."
    if announcement.left_out:
        shown = ", ".join(announcement.left_out)
        yield f"  Not covered by the server's own certificate (not private): {shown} (use --tls CERT KEY)."
    if not config.is_tls and not config.is_open:
        yield from (f"  {line}" for line in WITHOUT_HTTPS)
    if announcement.setup is not None and announcement.fingerprint is not None:
        yield ""
        yield f"  1. A phone that was never here, once: {announcement.setup}"
        if draws:
            yield from code(announcement.setup)
        yield f"     It shows a fingerprint. Go on only if it is this one, of “{announcement.authority}” (SHA-256):"
        yield from (f"       {line}" for line in fingerprint_lines(announcement.fingerprint))
        yield ""
    yield from _pairing(announcement, draws=draws)
    yield from (f"  {line}" for line in config.next_steps)
    yield "  Press Ctrl-C to stop."


def _pairing(announcement: Announcement, *, draws: bool) -> Iterator[str]:
    step = "2. " if announcement.setup is not None else ""
    if announcement.pairing is None or announcement.config.is_open:
        return
    if draws:
        yield from invitation(announcement.url, announcement.pairing, f"  {step}Pair a device:")
    else:  # what is not read by a person at a terminal ends in a log, where no PIN belongs
        yield f"  {step}Pair a device: on this machine `{announcement.pairing.command}` shows a code and a PIN."


def pair_command(data: Path | None) -> str:
    """As it finds the server that uses this data folder."""
    return "catgraph pair" if data is None or data == default_data() else f"catgraph pair --data {quote(str(data))}"


def invitation(url: str, pairing: Pairing, lead: str) -> Iterator[str]:
    """How the next device gets in, for a person before a terminal."""
    yield f"{lead} {url} with PIN {pairing.pin}, one device within {pairing.minutes} min; later: {pairing.command}"
    yield from code(f"{url}#pair={pairing.token}")


def code(text: str) -> list[str]:
    """A QR code in half blocks: black on white, whatever the terminal's colours are, for some readers take no other."""
    out = io.StringIO()
    segno.make(text, error="l").terminal(out, compact=True)
    return [f"{_WHITE_ON_BLACK}{line}{_AS_BEFORE}" for line in out.getvalue().rstrip("\n").split("\n")]


def fingerprint_lines(fingerprint: str) -> list[str]:
    """Four lines of eight pairs, as the page that explains has them, to be compared line by line."""
    pairs = fingerprint.split(":")
    return [" ".join(pairs[i : i + 8]) for i in range(0, len(pairs), 8)]


def addresses(where: SetupAddresses) -> tuple[str, tuple[str, ...]]:
    """The page's likeliest address, and the others that another device may try."""
    first = where.secure()
    others = [where.secure(host) for host in where.hosts if not _is_of_this_machine(host)]
    return first, tuple(one for one in others if one != first)


def _is_of_this_machine(host: str) -> bool:
    return host in ("localhost", "::1") or host.startswith("127.") or host.lower().startswith("fe80:")
