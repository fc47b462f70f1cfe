"""Prints what pages see over radios: `python -m tests.radio [--tree FOLDER]… [--seconds N] [--only NAME]…`.

Several trees are measured beside each other, each over a radio of its own.
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from tests.radio.rig import IS_POSSIBLE, ROOT, WHY_NOT, Air, on_air, page, serving


async def steady(air: Air, host: str, key: str, tree: Path, lasts_s: float, profile: str) -> str:
    await air.shape(profile)
    async with page(air, host, key, tree=tree) as seen:
        await asyncio.sleep(lasts_s)
    return seen.between(seen.begins_ms + 2000, time.time() * 1000).row()


async def cold(air: Air, host: str, key: str, tree: Path, lasts_s: float) -> str:
    """Starts over the worst radio."""
    await air.shape("bad")
    times = []
    for _ in range(max(2, round(lasts_s / 6))):
        async with page(air, host, key, tree=tree) as seen:
            began_s = time.monotonic()
            while time.monotonic() < began_s + 12 and seen.live_s(0) == float("inf"):
                await asyncio.sleep(0.1)
        times.append(seen.live_s(seen.begins_ms))
    within = sum(one <= 10 for one in times)
    return f"live within 10 s: {within} of {len(times)}, median {statistics.median(times):.1f} s"


async def gap(air: Air, host: str, key: str, tree: Path, off: str, off_s: float, every_s: float, times: int) -> str:
    """Over the fair radio, cut `times` times for `off_s`, with `every_s` from one cut to the next."""
    await air.shape("fair")
    first, live, youngest = [], [], []
    async with page(air, host, key, tree=tree) as seen:
        await asyncio.sleep(5)
        for _ in range(times):
            await air.shape(off)
            await asyncio.sleep(off_s)
            back_ms = await air.shape("fair")
            await asyncio.sleep(every_s - off_s)
            after = seen.between(back_ms, back_ms + 1000 * (every_s - off_s))
            first.append(after.first_s(back_ms))
            live.append(after.live_s(back_ms))
            youngest.append(after.frames[0][1] if after.frames else float("inf"))
    return f"first frame {shown(first)} s after the return, {shown(youngest)} s old; uncovered after {shown(live)} s"


def shown(values: list[float]) -> str:
    return f"{statistics.median(values):.2f} (≤ {max(values):.2f})"


async def car_steady(air: Air, host: str, key: str, tree: Path, lasts_s: float, profile: str) -> str:
    """The link to the car, seen by a page beside the server."""
    await air.shape("clean")
    async with page(air, host, key, tree=tree, end=0) as seen:
        await asyncio.sleep(5)
        began_ms = await air.shape(profile)
        await asyncio.sleep(lasts_s)
        ended_ms = await air.shape("clean")
    return seen.between(began_ms, ended_ms).car_row()


async def car_gap(air: Air, host: str, key: str, tree: Path, off: str, off_s: float, every_s: float, times: int) -> str:
    await air.shape("fair")
    back = []
    async with page(air, host, key, tree=tree, end=0) as seen:
        await asyncio.sleep(5)
        for _ in range(times):
            await air.shape(off)
            await asyncio.sleep(off_s)
            back_ms = await air.shape("fair")
            await asyncio.sleep(every_s - off_s)
            back.append(seen.car_back_s(back_ms))
    return f"back after {shown(back)} s"


Row = tuple[Callable[..., Awaitable[str]], tuple[object, ...]]


def phone_rows(seconds: float) -> dict[str, Row]:
    few, more = max(1, round(seconds / 30)), max(2, round(seconds / 15))
    return {
        **{f"phone, {name}": (steady, (seconds, name)) for name in ("fair", "weak", "bad")},
        "phone, cold, bad": (cold, (seconds,)),
        "phone, black-out 30 s": (gap, ("off", 30.0, 36.0, few)),
        "phone, down dead 20 s": (gap, ("a>b 0 0 100 0", 20.0, 26.0, few)),
        "phone, up dead 20 s": (gap, ("b>a 0 0 100 0", 20.0, 26.0, few)),
        "phone, 5 s off each 15 s": (gap, ("off", 5.0, 15.0, more)),
    }


def car_rows(seconds: float) -> dict[str, Row]:
    few, more = max(1, round(seconds / 30)), max(2, round(seconds / 15))
    return {
        **{f"car, {name}": (car_steady, (seconds, name)) for name in ("fair", "weak", "bad")},
        "car, black-out 30 s": (car_gap, ("off", 30.0, 40.0, few)),
        "car, down dead 20 s": (car_gap, ("b>a 0 0 100 0", 20.0, 30.0, few)),
        "car, 5 s off each 15 s": (car_gap, ("off", 5.0, 15.0, more)),
    }


async def measure(number: int, tree: Path, seconds: float, only: list[str]) -> dict[str, str]:
    """The rows of one tree whose name begins as one of `only`."""
    found: dict[str, str] = {}
    for car_end, rows in enumerate((phone_rows(seconds), car_rows(seconds))):
        wanted = {name: row for name, row in rows.items() if not only or name.startswith(tuple(only))}
        if not wanted:
            continue
        with tempfile.TemporaryDirectory() as data:
            async with on_air(number, "clean") as air, serving(air, Path(data), tree=tree, car_end=car_end) as served:
                for name, (run, more) in wanted.items():
                    found[name] = await run(air, *served, tree, *more)
                    print(f"{tree.name:8} {name:26} {found[name]}", flush=True)
    return found


async def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tree", type=Path, action="append")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--only", action="append", default=[])
    given = parser.parse_args()
    if not IS_POSSIBLE:
        parser.error(WHY_NOT)
    trees = [tree.resolve() for tree in given.tree or [ROOT]]
    await asyncio.gather(*(measure(i + 1, tree, given.seconds, given.only) for i, tree in enumerate(trees)))


if __name__ == "__main__":
    asyncio.run(main())
