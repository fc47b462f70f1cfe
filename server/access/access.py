"""Access to one server: who was invited, who is paired, who may come in. The one object that the rest asks."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from server.access import pending_invitations, secret_file
from server.access.active_connections import Visits
from server.access.cookie import Cookies
from server.access.devices import Device, Devices
from server.access.identity import LOCAL, Principal, Role
from server.access.invitations import PIN_DIGITS, Invitation, Invitations
from server.access.keys import Keys
from server.access.names import Names
from server.access.pin_throttle import Guesses
from server.access.tickets import Tickets
from server.control import display_name

log = logging.getLogger("catgraph.access")

FOLDER = "access"  # in the data folder; 0700, and every file in it 0600


class NotPaired(Exception):
    """The device was not let in; `str()` is one sentence for its owner, `code` a word for its page."""

    def __init__(self, code: str, sentence: str, *, wait_s: float | None = None) -> None:
        super().__init__(sentence)
        self.code = code
        self.wait_s = wait_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Admitted:
    """Who sent a request, by what it carries."""

    who: Principal
    by: str  # "local", "key" or "cookie"
    is_to_renew: str | None = None  # the Set-Cookie of a cookie that grows old


class Access:
    """Everything of one server that decides who is let in."""

    def __init__(
        self,
        data: Path | None,
        *,
        names: Sequence[str],
        keys: Keys,
        is_open: bool,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        """`data`: the data folder, None: nothing is kept. `names`: what else this server is called.
        `is_open`: everybody who reaches this server may act, because it listens on this machine only.

        Raises OSError where its folder cannot be used, ValueError where `names` holds nonsense.
        """
        self.is_open = is_open
        self._keys = keys
        self._now = now
        self._wall_ms = wall_ms
        self._folder: Path | None = None if data is None else data / FOLDER
        if self._folder is not None:
            secret_file.folder(self._folder)
        self.names = Names(names, is_open=is_open)
        self.devices = Devices(self._folder)
        self.visits = Visits()
        self._invitations = Invitations()
        self._printed: dict[Role, Invitation] = {}  # the one that stands on the terminal
        self._guesses = Guesses()
        self._tickets = Tickets()
        self._cookies = Cookies(self.devices.signing_key, self.devices.server, wall_ms=wall_ms)
        self._removed: dict[str, str] = {}  # devices that were removed in this run: why
        self.address: str | None = None  # where phones reach this server, as it was announced
        self.on_paired: Callable[[str, Role], None] = lambda name, role: None  # a device came in: its name and role

    # -- invitations -------------------------------------------------------------------------------------------------

    def invitation(self, role: Role = Role.OPERATOR) -> Invitation:
        """What stands on the terminal for the next device of this role: the same until it is used or too old."""
        now_s = self._now()
        printed = self._printed.get(role)
        if printed is None or printed not in self._invitations.standing(now_s):
            printed = self._printed[role] = self._invitations.new(role, now_s=now_s)
        return printed

    def another(self, role: Role) -> Invitation:
        """One more, for a device that an operator wants to pair."""
        return self._invitations.new(role, now_s=self._now())

    def invite(self, role: Role = Role.OPERATOR) -> str:
        """The token of the pairing link `https://HOST:PORT/#pair=TOKEN`."""
        return self.invitation(role).token

    def pin(self, role: Role = Role.OPERATOR) -> str:
        """The PIN of six digits that goes with it."""
        return self.invitation(role).pin

    def listens_at(self, address: str) -> None:
        """`address`: where phones reach this server, `https://192.168.4.1:8000/`. Kept for `catgraph pair`."""
        self.address = address
        if self._folder is not None and not self.is_open:
            try:
                pending_invitations.announce(self._folder, address)
            except OSError as why:
                log.warning("catgraph pair will not find this server: %s", why)

    # -- pairing -----------------------------------------------------------------------------------------------------

    def pair(self, *, token: str | None, pin: str | None, name: str, peer: str) -> tuple[Device, str]:
        """Lets a new device in for its invitation; the device and its secret. Raises NotPaired, OSError.

        Nothing is waited for in here, so that tries in parallel are judged one after another.
        """
        now_s = self._now()
        if self._folder is not None:
            for invitation in pending_invitations.collect(self._folder, now_s=now_s, wall_ms=self._wall_ms()):
                self._invitations.add(invitation, now_s=now_s)
        if token is not None:
            found = self._invitations.take(token=token, now_s=now_s)
            if found is None:
                raise NotPaired(
                    "used", "This link was used already, or it is older than 10 minutes. Ask for a new one."
                )
        else:
            found = self._by_pin(pin or "", _peer(peer), now_s)
        try:
            device, secret = self.devices.add(name, found.role, now_ms=self._wall_ms())
        except OSError:
            self._invitations.add(found, now_s=now_s)
            raise
        log.info("%s was paired as %s", device.name, device.role)
        self.on_paired(device.name, device.role)
        return device, secret

    def _by_pin(self, pin: str, peer: str, now_s: float) -> Invitation:
        wait_s = self._guesses.wait_s(peer, now_s=now_s)
        if wait_s > 0:
            raise NotPaired("wait", "Too many wrong PINs. Wait, or scan the QR code instead.", wait_s=wait_s)
        digits = "".join(letter for letter in pin if letter.isdecimal() and letter.isascii())
        standing = self._invitations.standing(now_s)
        found = self._invitations.take(pin=digits, now_s=now_s) if len(digits) == PIN_DIGITS else None
        if found is not None:
            self._guesses.right(peer)
            return found
        self._guesses.wrong(peer, now_s=now_s)
        wait_s = self._guesses.wait_s(peer, now_s=now_s)
        if not standing:
            raise NotPaired(
                "expired", "No PIN is valid now: it was used, or it is older than 10 minutes.", wait_s=wait_s
            )
        raise NotPaired("wrong", "This PIN is wrong.", wait_s=wait_s)

    # -- devices -----------------------------------------------------------------------------------------------------

    def remove(self, id: str, *, by: str, but: object = None) -> Device | None:
        """The device may not come any more, and what it has open ends now. `but`: a task that may end its answer.

        Raises OSError where the list cannot be kept: it is out now, and would be in again after a restart.
        """
        try:
            device = self.devices.remove(id, now_ms=self._wall_ms())
        finally:
            if self.devices.get(id) is None:
                self._removed[id] = f"This device was removed by {by}."
                self.visits.end(id, self._removed[id], but=but)
        return device

    def change(self, id: str, *, role: Role | None, name: str | None, but: object = None) -> Device | None:
        """The device with another role or name, which counts at once: its sockets begin anew. Raises OSError."""
        before = self.devices.get(id)
        clean = None if name is None else display_name.clean(name)
        device = self.devices.change(id, role=role, name=clean, now_ms=self._wall_ms())
        if device is not None and before is not None and (device.role, device.name) != (before.role, before.name):
            self.visits.end(
                id, "The role of this device was changed.", only_sockets=device.role == before.role, but=but
            )
        return device

    # -- who asks ----------------------------------------------------------------------------------------------------

    def known(self, headers: Mapping[str, str], *, scheme: str) -> Admitted | None:
        """Who sends these headers; None: nobody that is known. `scheme`: http or https."""
        if self.is_open:
            return Admitted(who=LOCAL, by="local")
        authorization = headers.get("authorization")
        if authorization is not None:
            program = self._keys.who(authorization)
            return None if program is None else Admitted(who=program, by="key")
        read = self._read_cookie(headers, scheme)
        if read is None:
            return None
        id, secret, is_old = read
        now_ms = self._wall_ms()
        device = self.devices.known(id, secret, now_ms=now_ms)
        if device is None:
            return None
        if (write := self.devices.seen(id, now_ms=now_ms)) is not None:
            asyncio.get_running_loop().run_in_executor(None, write)
        is_secure = self.is_secure(scheme, headers.get("host", ""))
        renewed = self._cookies.header(id, secret, is_secure=is_secure) if is_old else None
        return Admitted(
            who=Principal(id=device.id, name=device.name, role=device.role), by="cookie", is_to_renew=renewed
        )

    def why_unknown(self, headers: Mapping[str, str], *, scheme: str) -> tuple[str, str]:
        """A word and a sentence for who is not known: a device that was removed is told so."""
        if "authorization" in headers:
            return "key", "This key is not known to the server."
        read = self._read_cookie(headers, scheme)
        if read is None:
            return "unpaired", "This device is not paired with the server."
        return "removed", self._removed.get(read[0], "This device is not paired any more.")

    def is_secure(self, scheme: str, host: str) -> bool:
        """Whether the browser at the other end has TLS."""
        return scheme == "https" or self.names.is_behind_tls(host)

    def cookie(self, device: Device, secret: str, *, scheme: str, host: str) -> str:
        """The Set-Cookie for a device that was just paired."""
        return self._cookies.header(device.id, secret, is_secure=self.is_secure(scheme, host))

    def no_cookie(self, *, scheme: str, host: str) -> str:
        """The Set-Cookie that takes it away."""
        return self._cookies.gone(is_secure=self.is_secure(scheme, host))

    def _read_cookie(self, headers: Mapping[str, str], scheme: str) -> tuple[str, str, bool] | None:
        is_secure = self.is_secure(scheme, headers.get("host", ""))
        return self._cookies.read(headers.get("cookie", ""), is_secure=is_secure)

    # -- tickets -----------------------------------------------------------------------------------------------------

    def ticket(self, who: Principal) -> str:
        """A ticket for one socket of `who`, within 5 s."""
        return self._tickets.new(who.id, now_s=self._now())

    def use_ticket(self, ticket: str, who: Principal) -> bool:
        """Whether `who` may open a socket with it; it is used up."""
        return self._tickets.use(ticket, who.id, now_s=self._now())

    def stop(self) -> None:
        """When the server ends."""
        if not self.is_open:
            self.devices.seen_on_disk(now_ms=self._wall_ms())()
        if self._folder is not None:
            pending_invitations.retire(self._folder)


def _peer(address: str) -> str:
    """Who counts as one who guesses: an IPv4 address, or the network of an IPv6 one."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv6Address):
        if found.ipv4_mapped is not None:
            return str(found.ipv4_mapped)
        return str(ipaddress.ip_network((found, 64), strict=False))
    return str(found)


def this_task() -> object:
    """The task that answers the request which is answered now."""
    return asyncio.current_task()
