"""A mailer with a folder of recordings in place of the catalog, and a clock that is moved by hand."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

from server.mail.mailer import Mailer
from server.mail.order import Letter, Order
from server.recording.export import Made

START_MS = 1_790_000_000_000
OVER = ("sent", "failed", "cancelled")


class Shelf:
    """Recordings in a folder; another format is a copy with a line before it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.notes: list[str] = []  # what of a recording its exports do not hold
        self.drives: list[list[str]] = []  # recordings that are parts of one drive
        self.exported: list[list[str]] = []  # of which recordings each export was made
        folder.mkdir(parents=True, exist_ok=True)

    def put(self, name: str, content: bytes = b"a drive") -> Path:
        path = self.folder / f"{name}.mcap"
        path.write_bytes(content)
        return path

    def path_of(self, recording: str) -> Path | None:
        path = self.folder / f"{recording}.mcap"
        return path if path.is_file() else None

    def drive_of(self, recording: str) -> list[str]:
        return next((drive for drive in self.drives if recording in drive), [recording])

    async def export(
        self, paths: Sequence[Path], format: str, into: Path, progress: Callable[[float], None], *, required: Path
    ) -> Made:
        if format == "bag":
            raise ValueError("its messages have no definition")
        assert required in paths
        path = paths[0]
        self.exported.append([one.stem for one in paths])
        made = into / f"{path.stem}.{'zip' if format == 'csv' else format}"
        shutil.copyfile(path, made)
        progress(1.0)
        return Made(path=made, entries=1, notes=self.notes, is_whole=not self.notes)


class Clock:
    """Wall time, moved by hand."""

    def __init__(self) -> None:
        self.ms = START_MS

    def __call__(self) -> int:
        return self.ms


def settings(port: int, **more: Any) -> dict[str, Any]:
    return {
        "host": "127.0.0.1",
        "port": port,
        "security": "none",
        "sender": "catgraph@test.example",
        **more,
    }


def order(*recordings: str, **more: Any) -> Order:
    facts: dict[str, Any] = {
        "recordings": recordings or ("drive",),
        "format": "mcap",
        "to": ("ann@example.org",),
        "subject": "Drive",
        "text": "See alarm 3.",
        "too_large": "split",
        **more,
    }
    return Order(**facts)


@contextlib.asynccontextmanager
async def mailing(folder: Path, shelf: Shelf, clock: Clock | None = None, **more: Any) -> AsyncIterator[Mailer]:
    mailer = Mailer(folder, shelf, wall_ms=clock or Clock(), **more)
    await mailer.start()
    try:
        yield mailer
    finally:
        await mailer.stop()


async def until(mailer: Mailer, n: int, fits: Callable[[Letter], bool], within_s: float = 30.0) -> Letter:
    async with asyncio.timeout(within_s):
        while not fits(letter := await mailer.letter(n)):
            await asyncio.sleep(0.01)
    return letter


async def over(mailer: Mailer, n: int, within_s: float = 30.0) -> Letter:
    return await until(mailer, n, lambda letter: letter.state in OVER, within_s)
