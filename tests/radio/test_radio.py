"""The page and the car's link over radios as they are outdoors: a short round in the field, a long one in the soak."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from tests.radio.__main__ import car_rows, phone_rows
from tests.radio.rig import IS_POSSIBLE, ROOT, WHY_NOT, on_air, page, serving

pytestmark = [pytest.mark.skipif(not IS_POSSIBLE, reason=WHY_NOT), pytest.mark.timeout(600)]

UNDER_S = 0.25  # 0.2 s, and the reading of two clocks


@pytest.mark.field
async def test_over_each_radio_values_come_and_none_is_shown_younger_than_it_is(tmp_path: Path) -> None:
    async with on_air(1, "clean") as air, serving(air, tmp_path) as served, page(air, *served) as seen:
        await asyncio.sleep(4)
        for profile in ("fair", "weak", "bad"):
            began_ms = await air.shape(profile)
            await asyncio.sleep(15)
            then = seen.between(began_ms, time.time() * 1000)
            assert then.frames, profile
            assert then.youngest_s >= -UNDER_S, (profile, then.row())
        await air.shape("off")
        await asyncio.sleep(6)
        assert seen.samples[-1][1], "the values are covered"
        back_ms = await air.shape("fair")
        await asyncio.sleep(10)
        assert seen.first_s(back_ms) < 8.0
        assert seen.between(back_ms, time.time() * 1000).youngest_s >= -UNDER_S


SOAK_S = 45.0
ROWS = (phone_rows(SOAK_S), car_rows(SOAK_S))


@pytest.mark.soak
@pytest.mark.parametrize(("car_end", "name"), [(end, name) for end, rows in enumerate(ROWS) for name in rows])
async def test_each_radio_for_a_while(tmp_path: Path, car_end: int, name: str) -> None:
    run, more = ROWS[car_end][name]
    async with on_air(1, "clean") as air, serving(air, tmp_path, car_end=car_end) as served:
        found = await run(air, *served, ROOT, *more)
    print(found)  # the row of `make soak`
    assert "inf" not in found
