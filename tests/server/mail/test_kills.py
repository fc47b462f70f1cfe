"""The sender is killed, the server refuses for a while and loses its replies: all arrives, each duplicate is known."""

from __future__ import annotations

import asyncio
import hashlib
import random
import re
import sys
from pathlib import Path

import pytest

from tests.server.mail.mailing import Shelf
from tests.server.mail.post import Post, posting, read
from tests.tree import PROJECT

LARGE = hashlib.shake_256(b"drive").digest(250_000)  # three parts at the limit of 0.1 MB
SEED = 20


async def sending(tmp_path: Path, port: int, orders: int) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.server.mail.sender"),
        *(str(tmp_path / "mail"), str(tmp_path / "shelf"), str(port), str(orders)),
        cwd=PROJECT,
        stdout=asyncio.subprocess.PIPE,
    )


async def printed(process: asyncio.subprocess.Process, start: str) -> None:
    assert process.stdout is not None
    while line := (await process.stdout.readline()).decode():
        if line.startswith(start):
            return
    raise AssertionError(f"the sender ended before it printed “{start}”")


async def killed_again_and_again(tmp_path: Path, post: Post, orders: int, kills: int, within_s: float) -> None:
    """Kills the sender when a random further share of the mails has arrived, then lets it come to its end."""
    chance = random.Random(SEED)
    mails = orders + 2 * (orders // 10)  # every tenth is three
    # Not at one moment of the work but anywhere: while ordering, preparing, sending, between mails.
    at = sorted(chance.uniform(0.0, 0.9) * mails for _ in range(kills))
    async with asyncio.timeout(within_s):
        for count in at:
            process = await sending(tmp_path, post.port, orders)
            await printed(process, "started")
            while len({one["message_id"] for one in post.taken}) < count:
                assert process.returncode is None, "the sender ended by itself"
                await asyncio.sleep(0.01)
            await asyncio.sleep(chance.uniform(0.0, 0.1))
            process.kill()
            await process.wait()
        process = await sending(tmp_path, post.port, orders)
        await printed(process, "over")
        assert await process.wait() == 0


def judge(post: Post, orders: int) -> int:
    """Every mail is there, whole, and what came twice is the same under the same name; how many came twice."""
    by_id: dict[str, list[dict[str, object]]] = {}
    for one in post.taken:
        by_id.setdefault(str(one["message_id"]), []).append(one)
    names = [re.fullmatch(r"<order-(\d{4})\.[0-9a-f]{12}\.(\d)of(\d)@test\.example>", one) for one in by_id]
    assert all(names), "a mail that nobody ordered"
    found = {(int(name[1]), int(name[2]), int(name[3])) for name in names if name}
    wanted = {
        (i, part, parts) for i in range(orders) for parts in [3 if i % 10 == 9 else 1] for part in range(1, parts + 1)
    }
    assert sorted(wanted - found) == [], "lost"
    assert sorted(found - wanted) == [], "not ordered"
    for copies in by_id.values():
        assert len({(one["sha256"], one["date"]) for one in copies}) == 1, "a duplicate that cannot be recognised"
    for i in range(9, orders, 10):
        parts = sorted(one[0]["file"] for name, one in by_id.items() if name.startswith(f"<order-{i:04}."))
        contents, text = {}, ""
        for file in parts:
            mail = read(post.folder / str(file))
            text = next(mail.iter_parts()).get_content()
            attached = next(mail.iter_attachments())
            contents[attached.get_filename()] = attached.get_content()
        whole = b"".join(contents[name] for name in sorted(contents, key=str))
        assert hashlib.sha256(whole).hexdigest() in text
    return sum(len(copies) - 1 for copies in by_id.values())


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(120)
async def test_none_is_lost_through_kills_refusals_and_lost_replies(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path / "shelf")
    shelf.put("small")
    shelf.put("large", LARGE)
    async with posting(tmp_path / "post", "--temporary", "0.1", "--lost", "0.1") as post:
        await killed_again_and_again(tmp_path, post, orders=40, kills=2, within_s=90)
        twice = judge(post, 40)
    assert twice > 0, "no reply was lost: nothing was tried here"


@pytest.mark.soak
@pytest.mark.timeout(1800)
async def test_five_hundred_mails_through_six_kills(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path / "shelf")
    shelf.put("small")
    shelf.put("large", LARGE)
    async with posting(tmp_path / "post", "--temporary", "0.1", "--lost", "0.05") as post:
        await killed_again_and_again(tmp_path, post, orders=500, kills=6, within_s=1700)
        twice = judge(post, 500)
        print(f"500 orders: {len(post.taken)} mails taken, {len(post.taken) - twice} different, {twice} duplicates")
