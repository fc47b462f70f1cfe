"""Access to one server: who was invited, who is paired, who may come in. The one object that the rest asks."""

from __future__ import annotations

from collections.abc import Callable

from server.access.invitations import Invitation, Invitations
from server.access.who import Role
from server.config import Config


class Access:
    """Everything of one server that decides who is let in."""

    def __init__(self, config: Config, *, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._config = config
        self._now = now
        self._wall_ms = wall_ms
        self._invitations = Invitations()
        self._printed: dict[Role, Invitation] = {}  # the one that stands on the terminal
        self.on_paired: Callable[[str, Role], None] = lambda name, role: None  # a device came in: its name and role

    @property
    def is_open(self) -> bool:
        """Whether everybody who reaches this server may act: it listens on this machine only."""
        return self._config.is_open

    def invitation(self, role: Role = Role.OPERATOR) -> Invitation:
        """What stands on the terminal for the next device of this role: the same until it is used or too old."""
        now_s = self._now()
        printed = self._printed.get(role)
        if printed is None or printed not in self._invitations.standing(now_s):
            printed = self._printed[role] = self._invitations.new(role, now_s=now_s)
        return printed

    def invite(self, role: Role = Role.OPERATOR) -> str:
        """The token of the pairing link `https://HOST:PORT/#pair=TOKEN`."""
        return self.invitation(role).token

    def pin(self, role: Role = Role.OPERATOR) -> str:
        """The PIN of six digits that goes with it."""
        return self.invitation(role).pin
