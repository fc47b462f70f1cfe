"""Access control of one server: invitations, paired devices, authentication. The package's only interface."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from server.access import invitations, secret_file
from server.access.active_connections import ActiveConnections
from server.access.credentials import Cookies, Keys, Tickets
from server.access.devices import Device, Devices
from server.access.identity import LOCAL, Principal, Role
from server.access.invitations import PIN_DIGITS, Invitation, Invitations, PinThrottle
from server.access.names import Names
from server.control import display_name
from server.storage.storage_thread import StorageThread

log = logging.getLogger("catgraph.access")

T = TypeVar("T")
FOLDER = "access"  # in the data folder; 0700, and every file in it 0600


class NotPaired(Exception):
    """Pairing failed; `str()` is a sentence for the user, `code` is for the page."""

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
    """The authentication of one server: who is admitted."""

    def __init__(
        self,
        data: Path | None,
        *,
        names: Sequence[str],
        keys: Keys,
        is_open: bool,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        storage: StorageThread | None = None,
    ) -> None:
        """`data`: the data folder, None: nothing is kept. `names`: what else this server is called.
        `is_open`: everybody who reaches this server may act, because it listens on this machine only.
        `storage`: the thread that uses the folder; None: the caller waits for the disk.

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
        self._storage = storage
        self.devices = Devices(self._folder, storage=storage)
        self.visits = ActiveConnections()
        self._invitations = Invitations()
        self._printed: dict[Role, Invitation] = {}  # the one shown on the terminal
        self._pin_throttle = PinThrottle()
        self._tickets = Tickets()
        self.use_identity()
        self.removed: dict[str, str] = {}  # devices that were removed in this run: why
        self.address: str | None = None  # where phones reach this server, as it was announced
        self.on_paired: Callable[[str, Role], None] = lambda name, role: None  # a device came in: its name and role

    def use_identity(self) -> None:
        """From now on cookies are signed with the key of the list of devices."""
        self._cookies = Cookies(self.devices.signing_key, self.devices.server, wall_ms=self._wall_ms)

    # -- invitations ---------------------------------------------------------------------------------------------------

    def invitation(self, role: Role = Role.OPERATOR) -> Invitation:
        """The invitation shown on the terminal for this role: the same until it is used or expires."""
        now_s = self._now()
        printed = self._printed.get(role)
        if printed is None or printed not in self._invitations.standing(now_s):
            printed = self._printed[role] = self._invitations.new(role, now_s=now_s)
        return printed

    def another(self, role: Role) -> Invitation:
        """One more, for a device that an operator wants to pair."""
        return self._invitations.new(role, now_s=self._now())

    def listens_at(self, address: str) -> None:
        """`address`: where phones reach this server, `https://192.168.4.1:8000/`. Kept for `catgraph pair`."""
        self.address = address
        if self._folder is not None and not self.is_open:
            try:
                invitations.announce_server(self._folder, address)
            except OSError as why:
                log.warning("catgraph pair will not find this server: %s", why)

    # -- pairing -------------------------------------------------------------------------------------------------------

    async def pair(self, *, token: str | None, pin: str | None, name: str, peer: str) -> tuple[Device, str]:
        """Lets a new device in for its invitation; the device and its secret, once the disk has it.

        Raises NotPaired, OSError. A caller that is cancelled leaves it to its end.
        """
        return await _to_its_end(self._pair(token, pin, name, peer))

    async def _pair(self, token: str | None, pin: str | None, name: str, peer: str) -> tuple[Device, str]:
        await self._collect()
        found = self._judge(token, pin, peer)
        try:
            device, secret = await self.devices.add(name, found.role, now_ms=self._wall_ms())
        except OSError:
            self._invitations.add(found, now_s=self._now())
            raise
        log.info("device paired: name=%s role=%s", device.name, device.role)
        self.on_paired(device.name, device.role)
        return device, secret

    async def _collect(self) -> None:
        """Takes the invitations that `catgraph pair` wrote into the folder."""
        if self._folder is None:
            return
        now_s = self._now()
        collect = partial(invitations.collect_invitations, self._folder, now_s=now_s, wall_ms=self._wall_ms())
        for invitation in collect() if self._storage is None else await self._storage.run(collect):
            self._invitations.add(invitation, now_s=now_s)

    def _judge(self, token: str | None, pin: str | None, peer: str) -> Invitation:
        """The invitation, which is used up. Raises NotPaired.

        Nothing is waited for in here, so that tries in parallel are judged one after another.
        """
        now_s = self._now()
        if token is not None:
            found = self._invitations.take(token=token, now_s=now_s)
            if found is None:
                raise NotPaired("used", "This link was used already or is older than 10 minutes. Request a new one.")
            return found
        return self._by_pin(pin or "", _peer(peer), now_s)

    def _by_pin(self, pin: str, peer: str, now_s: float) -> Invitation:
        wait_s = self._pin_throttle.wait_s(peer, now_s=now_s)
        if wait_s > 0:
            raise NotPaired("wait", "Too many wrong PINs. Wait, or scan the QR code instead.", wait_s=wait_s)
        digits = "".join(letter for letter in pin if letter.isdecimal() and letter.isascii())
        standing = self._invitations.standing(now_s)
        found = self._invitations.take(pin=digits, now_s=now_s) if len(digits) == PIN_DIGITS else None
        if found is not None:
            self._pin_throttle.right(peer)
            return found
        self._pin_throttle.wrong(peer, now_s=now_s)
        wait_s = self._pin_throttle.wait_s(peer, now_s=now_s)
        if not standing:
            raise NotPaired("expired", "No PIN is valid now: it was used or is older than 10 minutes.", wait_s=wait_s)
        raise NotPaired("wrong", "This PIN is wrong.", wait_s=wait_s)

    # -- devices -------------------------------------------------------------------------------------------------------

    async def remove(self, id: str, *, by: str, but: object = None) -> Device | None:
        """The device may not come any more, and what it has open ends now. `but`: a task that may end its answer.

        Raises OSError where the list cannot be kept: it is out now, and would be in again after a restart.
        """
        device = self.devices.remove(id, now_ms=self._wall_ms())
        self.removed[id] = f"This device was removed by {by}."
        self.visits.end(id, self.removed[id], but=but)
        if device is not None:
            await _to_its_end(self.devices.save(now_ms=self._wall_ms()))
        return device

    async def change(self, id: str, *, role: Role | None, name: str | None, but: object = None) -> Device | None:
        """Change role or name of a device at once; its sockets are closed. Returns the device.

        Raises OSError if the list cannot be stored: nothing changed then.
        """
        before = self.devices.get(id)
        device = self.devices.change(
            id, role=role, name=None if name is None else display_name.clean(name), now_ms=self._wall_ms()
        )
        if device is not None and before is not None and (device.role, device.name) != (before.role, before.name):
            await _to_its_end(self._keep_changed(before, device, but))
        return device

    async def _keep_changed(self, before: Device, device: Device, but: object) -> None:
        because, only_sockets = "The role of this device was changed.", device.role == before.role
        self.visits.end(device.id, because, only_sockets=only_sockets, but=but)
        try:
            await self.devices.save(now_ms=self._wall_ms())
        except OSError:
            self.devices.put(before)
            self.visits.end(device.id, because, only_sockets=only_sockets, but=but)
            raise

    # -- identities ----------------------------------------------------------------------------------------------------

    def known(self, headers: Mapping[str, str], *, scheme: str) -> Admitted | None:
        """The principal that these headers authenticate; None: unknown. `scheme`: http or https."""
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
        self.devices.seen(id, now_ms=now_ms)
        is_secure = self.is_secure(scheme, headers.get("host", ""))
        renewed = self._cookies.header(id, secret, is_secure=is_secure) if is_old else None
        return Admitted(
            who=Principal(id=device.id, name=device.name, role=device.role), by="cookie", is_to_renew=renewed
        )

    def why_unknown(self, headers: Mapping[str, str], *, scheme: str) -> tuple[str, str]:
        """Code and sentence of a failed authentication; distinguishes a removed device."""
        if "authorization" in headers:
            return "key", "This key is not known to the server."
        read = self._read_cookie(headers, scheme)
        if read is None:
            return "unpaired", "This device is not paired with the server."
        return "removed", self.removed.get(read[0], "This device is no longer paired.")

    def is_secure(self, scheme: str, host: str) -> bool:
        """Whether the browser at the other end has TLS."""
        return scheme == "https" or self.names.is_behind_tls(host)

    def cookie(self, device: Device, secret: str, *, scheme: str, host: str) -> str:
        """The Set-Cookie for a device that was just paired."""
        return self._cookies.header(device.id, secret, is_secure=self.is_secure(scheme, host))

    def _read_cookie(self, headers: Mapping[str, str], scheme: str) -> tuple[str, str, bool] | None:
        is_secure = self.is_secure(scheme, headers.get("host", ""))
        return self._cookies.read(headers.get("cookie", ""), is_secure=is_secure)

    # -- tickets -------------------------------------------------------------------------------------------------------

    def ticket(self, who: Principal) -> str:
        """A ticket for one socket of `who`, within 5 s."""
        return self._tickets.new(who.id, now_s=self._now())

    def next_ticket(self, who: Principal) -> AbstractContextManager[str]:
        """A ticket for the socket after the one that is served meanwhile; "": none is needed."""
        return nullcontext("") if self.is_open else self._tickets.beside_socket(who.id, now=self._now)

    def use_ticket(self, ticket: str, who: Principal) -> bool:
        """Whether `who` may open a socket with it; it is used up."""
        return self._tickets.use(ticket, who.id, now_s=self._now())

    def stop(self) -> None:
        """When the server ends."""
        if not self.is_open:
            self.devices.save_seen(now_ms=self._wall_ms())
        if self._folder is None:
            return
        retire = partial(invitations.retire_server, self._folder)
        if self._storage is None:
            retire()
        else:
            self._storage.submit(retire)


async def _to_its_end(work: Coroutine[Any, Any, T]) -> T:
    """Return the result of `work`, which continues if the caller is cancelled."""
    return await asyncio.shield(asyncio.create_task(work))


def _peer(address: str) -> str:
    """By what failed attempts are counted: an IPv4 address, or the network of an IPv6 address."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv6Address):
        if found.ipv4_mapped is not None:
            return str(found.ipv4_mapped)
        return str(ipaddress.ip_network((found, 64), strict=False))
    return str(found)
