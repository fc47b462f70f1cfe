"""Changes the settings of one vehicle: stored first, then in force, one change after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from server.control.authorization import Caller
from server.judge.settings import Settings
from server.protocol import commands
from server.storage.storage_thread import StorageThread
from server.vehicle.session_parts import SessionActions, SessionParts


class SettingsChange:
    """`now` is a monotonic clock in seconds; `storage` the thread that writes settings; None: the caller waits for the
    disk."""

    def __init__(
        self, parts: SessionParts, actions: SessionActions, now: Callable[[], float], storage: StorageThread | None
    ) -> None:
        self._parts = parts
        self._actions = actions
        self._now = now
        self._storage = storage
        self._changing = asyncio.Lock()

    async def change(self, command: commands.Set | commands.Import, caller: Caller) -> None:
        """Stores settings and puts them in force; both happen though the caller waits no longer.

        Raises BadSetting, Conflict, OSError.
        """
        parts, by = self._parts, caller.name
        if isinstance(command, commands.Import):  # a file may take a while to read, and control may pass meanwhile
            read = await asyncio.to_thread(parts.settings.read, command.toml)
            parts.authorization.admit(command, caller, self._now())
            prepare = partial(parts.settings.prepare_all, read)
        else:
            prepare = partial(
                parts.settings.prepare,
                values=command.values,
                topics=command.topics,
                units=command.units,
                profile=command.profile,
                version=command.version,
            )
        await asyncio.shield(asyncio.create_task(self._store_and_adopt(prepare, by), name="change settings"))

    async def _store_and_adopt(self, prepare: Callable[[], Settings], by: str) -> None:
        settings = self._parts.settings
        async with self._changing:  # one after the other: each is prepared from what the one before put in force
            new = prepare()
            if self._storage is None:
                settings.store(new)
            else:
                await self._storage.run(lambda: settings.store(new))
            self._actions.settings_changed(settings.adopt(new), by=by)
            self._parts.publisher.put()
