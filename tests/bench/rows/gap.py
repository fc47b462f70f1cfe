"""What a viewer sees first after it could not read for a while."""

from __future__ import annotations

from tests.bench.child import Failed
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

PAGES = 8  # they read again at different moments of the server's tick


def measure(rig: Rig) -> Group:
    """Age of the first state, and how many stale ones follow."""
    gap_s = rig.pace.gap_s
    with rig.pages(PAGES, scan=True) as pages:
        ours = pages.ask("gap", seconds=gap_s)
    with rig.direct() as direct:
        (today,) = direct.ask("gap", seconds=gap_s)
    if any(page["first_age_s"] is None for page in ours):
        raise Failed(f"a page got no state after {gap_s:g} s without reading")
    rtt_s = max(page["rtt_s"] for page in ours)
    first = Row(
        what="age of the first state, oldest",
        unit="ms",
        catgraph=1000 * max(page["first_age_s"] for page in ours),
        today=1000 * today["first_age_s"],
        reach=1000 * rtt_s + 100,
        digits=1,
    )
    stale = Row(
        what="stale frames after it",
        unit="",
        catgraph=sum(page["stale"] for page in ours),
        today=today["stale"],
        reach=0,
        digits=0,
    )
    return Group(
        name="gap",
        title=f"After {gap_s:g} s in which the viewer did not read, {PAGES} pages",
        rows=(first, stale),
        notes=(
            f"round trip {1000 * rtt_s:.1f} ms; the pages let go by the server: {sum(p['closed'] for p in ours)}",
            "today: every message of the gap waits in line, the oldest first",
        ),
    )
