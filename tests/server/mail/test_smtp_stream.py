"""The file of a mail, opened off the loop."""

from __future__ import annotations

import asyncio
import gc
import os
from pathlib import Path

import pytest

from server.mail.smtp_connection import opened


async def test_a_file_that_is_being_opened_when_its_mail_is_cancelled_is_closed(tmp_path: Path) -> None:
    """A pipe opens for reading once somebody writes."""
    pipe = tmp_path / "mail.eml"
    os.mkfifo(pipe)

    async def send() -> None:
        async with opened(pipe):
            raise AssertionError("it is opened after it was cancelled")

    sending = asyncio.create_task(send())
    await asyncio.sleep(0)
    sending.cancel()
    with pytest.raises(asyncio.CancelledError):
        await sending
    await asyncio.to_thread(pipe.write_bytes, b"")
    await asyncio.gather(*asyncio.all_tasks() - {asyncio.current_task()})  # it is open
    await asyncio.sleep(0)
    gc.collect()  # an open file that nobody holds would be reported now, which fails the test


async def test_a_file_that_is_missing_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        async with opened(tmp_path / "none.eml"):
            pass
