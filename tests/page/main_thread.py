"""What the page costs a phone: the main thread's share, how evenly it draws, and its heap, with a slowed processor."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from playwright.async_api import CDPSession, Page

THROTTLE = 4  # a phone of the middle class beside a desktop computer, as Lighthouse has it
WATCH = """() => {
  window.frames_ms = [];
  let last = performance.now();
  const note = (now) => {
    window.frames_ms.push(now - last);
    last = now;
    requestAnimationFrame(note);
  };
  requestAnimationFrame(note);
  window.scans = 0;
  const kept = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...more) {
    window.scans += message.picture ? 1 : 0;  // the next one is requested when one is drawn
    return kept.call(this, message, ...more);
  };
}"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Of a time in which the page was watched."""

    share: float  # of the main thread: its own processor time times the throttle, so that others here do not count
    own_share: float  # of it what the page itself causes: scripts, style and layout, without the painting
    wall_share: float  # with the processor really throttled, by the clock on the wall: they do
    scans_hz: float  # drawings of the plot; this and the rest with the processor throttled
    frames_hz: float
    frame_p50_ms: float
    frame_p99_ms: float

    def __str__(self) -> str:
        frames = f"{self.frames_hz:.0f} frames/s, p50 {self.frame_p50_ms:.1f} ms, p99 {self.frame_p99_ms:.1f} ms"
        own = f"{100 * self.own_share:.0f} % scripts, style, layout; {100 * self.wall_share:.0f} % by the wall"
        return f"main thread {100 * self.share:.0f} % ({own}), {self.scans_hz:.1f} scans/s, {frames}"


async def measure(page: Page, seconds: float, *, throttle: int = THROTTLE) -> Cost:
    """Watches the page for so long: one half as it is, the other with its processor slowed down."""
    cdp = await page.context.new_cdp_session(page)
    try:
        await cdp.send("Performance.enable", {"timeDomain": "threadTicks"})
        share, own = (throttle * one for one in await _shares(cdp, seconds / 2))
        await cdp.send("Performance.disable")
        await cdp.send("Performance.enable", {"timeDomain": "timeTicks"})
        await cdp.send("Emulation.setCPUThrottlingRate", {"rate": throttle})
        await page.evaluate(WATCH)
        begun_s = time.monotonic()
        wall, _ = await _shares(cdp, seconds / 2)
        frames, scans = await page.evaluate("[window.frames_ms.slice(2), window.scans]")
        took_s = time.monotonic() - begun_s
    finally:
        await cdp.send("Emulation.setCPUThrottlingRate", {"rate": 1})
        await cdp.detach()
    return Cost(
        share=share,
        own_share=own,
        wall_share=wall,
        scans_hz=scans / took_s,
        frames_hz=1000 / float(np.mean(frames)),
        frame_p50_ms=float(np.median(frames)),
        frame_p99_ms=float(np.percentile(frames, 99)),
    )


async def _shares(cdp: CDPSession, seconds: float) -> tuple[float, float]:
    before, begun_s = await _spent(cdp), time.monotonic()
    await asyncio.sleep(seconds)
    after, took_s = await _spent(cdp), time.monotonic() - begun_s
    return (after[0] - before[0]) / took_s, (after[1] - before[1]) / took_s


async def heap_bytes(page: Page) -> float:
    """What the page's scripts hold on to once all garbage is gone."""
    cdp = await page.context.new_cdp_session(page)
    try:
        await cdp.send("HeapProfiler.enable")
        await cdp.send("HeapProfiler.collectGarbage")
        used: dict[str, Any] = await cdp.send("Runtime.getHeapUsage")
        return float(used["usedSize"])
    finally:
        await cdp.detach()


async def _spent(cdp: CDPSession) -> tuple[float, float]:
    """Seconds of all tasks, and of scripts, style and layout."""
    metrics = {one["name"]: float(one["value"]) for one in (await cdp.send("Performance.getMetrics"))["metrics"]}
    return metrics["TaskDuration"], sum(metrics[f"{name}Duration"] for name in ("Script", "Layout", "RecalcStyle"))
