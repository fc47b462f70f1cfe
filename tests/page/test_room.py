"""What a person needs of a scene is in sight, whole and without scrolling, on the window where that is hardest."""

from __future__ import annotations

import pytest

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import COMPLETE, show

#: Of what is hidden there is none, and no comparison with it holds.
RECT = (
    "const at = (one) => { const box = document.querySelector(one).getBoundingClientRect();"
    " return box.width && box.height ? box : {} };"
)
#: Scene, window, what holds there.
ROOM = {
    "the counts of a recording stand beside its length": (
        "files", 360, 740, "() => document.querySelector('.file:not([data-live]) .facts-line').clientHeight < 25",
    ),
    "the search stands beside what is stored": (
        "files", 740, 360, f"() => {{ {RECT} return at('.files-find').top < at('.files .sec').bottom - 8 }}",
    ),
    "that there are no alarms is read once beside a sheet": (
        "menu", 412, 915,
        "() => ['.strip', '.sheet-head .worst'].filter((one) => document.querySelector(one).checkVisibility()).length"
        " === 1",
    ),
    "an alarm is named once above a sheet": (
        "left", 412, 915,
        "() => ['.strip', '.sheet-head .worst'].filter((one) => document.querySelector(one).checkVisibility()).length"
        " === 1",
    ),
    "two actions of a recording are in sight, beside what it is": (
        "files-menu", 740, 360,
        f"() => {{ {RECT} return at('[data-f=file-actions] li:nth-child(2)').bottom <= at('#monitor > .rail').top"
        " && at('#sheet-file').width === innerWidth"
        " && at('#sheet-file .bd').right <= at('#sheet-file .what').left }",
    ),
    "recipients and subject of a mail are in sight on a phone on its side, beside its keys": (
        "mail", 740, 360,
        f"() => {{ {RECT} return at('#mail-subject').bottom <= at('#sheet-mail').bottom"
        " && at('#mail-subject').right <= at('#sheet-mail .keys').left }",
    ),
    "recipients and subject of a mail are in sight on a low phone": (
        "mail", 360, 640, f"() => {{ {RECT} return at('#mail-subject').bottom <= at('#sheet-mail .keys').top }}",
    ),
    "the line to be read back is in sight": (
        "handover", 360, 740, f"() => {{ {RECT} return at('.tick[data-next]').bottom <= at('.duty-keys').top }}",
    ),
    "an intervention is described without scrolling": (
        "take-over", 412, 915,
        "() => { const body = document.querySelector('.mark-body'); return body.scrollHeight <= body.clientHeight }",
    ),
    "a planned stop is shown above a notice, which covers no distance": (
        "planned-stop", 740, 360,
        f"() => {{ {RECT} return at('.planned-stop').height > 20"
        " && at('.snack').height > 0 && at('.near').bottom <= at('.snack').top }",
    ),
    "a notice covers no distance on a phone on its side": (
        "home-warning", 740, 360, f"() => {{ {RECT} return at('.near').bottom <= at('.snack').top }}",
    ),
    "the order of a slow-down that fails is whole": (
        "slow-down-not-confirmed", 412, 360,
        "() => { const text = document.querySelector('#sheet-alarm .slide .tx');"
        " return text.checkVisibility() && text.scrollHeight <= text.clientHeight }",
    ),
    "what is known of the beams is in sight beneath the scan": (
        "scan", 360, 740,
        f"() => {{ {RECT} return at('#panel-scan [data-f=beams]').bottom <= at('.ledge').top + 1 }}",
    ),
    "every choice of the preferences is in sight in a tablet's drawer": (
        "preferences", 820, 1180,
        f"() => {{ {RECT} return at('[data-sound-key=low]').bottom <= at('#sheet-preferences .keys').top }}",
    ),
    "the distance ahead is read whole beside a slow-down that fails, on a phone on its side": (
        "slow-down-not-confirmed-seen",
        740,
        360,
        f"() => {{ {RECT} const end = at('.near').bottom;"
        " return document.querySelector('.ledge').hidden && end <= at('#monitor > .rail').top }",
    ),
    "the distance is beside the gauge on a small phone on its side": (
        "home", 640, 360,
        f"() => {{ {RECT} const [near, gauge] = [at('.near'), at('.gauge')];"
        " return near.bottom <= at('#monitor > .rail').top && gauge.right <= near.left"
        " && at('.near [data-f=stops]').right <= innerWidth }",
    ),
    "the car is in the picture of the scan on a small phone on its side": (
        "scan", 640, 360, f"() => {{ {RECT} return at('.scanc').bottom <= at('#monitor > .rail').top + 1 }}",
    ),
    "two cars are whole over a notice of one of them on a low phone": (
        "cars", 360, 640,
        f"() => {{ {RECT} return at('#sheet-cars > .cars li:nth-child(2)').bottom <= at('.snack.other').top }}",
    ),
    "a warning covers no distance beside a slow-down that fails, on a phone on its side": (
        "slow-down-not-confirmed-warned", 740, 360,
        f"() => {{ {RECT} return at('.near [data-f=distance]').bottom <= at('.snack').top + 1 }}",
    ),
    "a warning covers no sentence of a slow-down that fails, and the speed is whole, on a small phone on its side": (
        "slow-down-not-confirmed-warned", 568, 320,
        f"() => {{ {RECT} const [order, snack, speed] = ['.under > .order p', '.snack', '.gauge .speed'].map(at);"
        " return order.height > 12 && order.bottom < snack.top && speed.bottom <= at('#monitor > .view').bottom }",
    ),
    "the distance is read whole over the Mark key on the smallest phone": (
        "home", 320, 568, f"() => {{ {RECT} return at('.near').bottom <= at('.ledge').top + 1 }}",
    ),
    "a choice and the key that closes are in sight in the preferences of a small phone on its side": (
        "preferences", 640, 360,
        f"() => {{ {RECT} const end = at('#monitor > .rail').top + 1;"
        " return at('#sheet-preferences .seg').top >= at('#sheet-preferences .sheet-head').bottom - 1"
        " && at('#sheet-preferences .seg').height > 40 && at('#sheet-preferences .seg').bottom <= end"
        " && at('#sheet-preferences > .keys > *').bottom <= end }",
    ),
    "three choices of the preferences are in sight on a phone on its side": (
        "preferences", 740, 360,
        f"() => {{ {RECT} return at('#sheet-preferences .seg:nth-of-type(3)').height > 40"
        " && at('#sheet-preferences .seg:nth-of-type(3)').bottom <= at('#monitor > .view').bottom }",
    ),
    "a line of the menu and the key that closes it are in sight on a small phone on its side": (
        "menu", 640, 360,
        f"() => {{ {RECT} const end = at('#monitor > .rail').top + 1;"
        " return at('#sheet-menu li').top >= at('#sheet-menu .sheet-head').bottom - 1"
        " && at('#sheet-menu li').bottom <= end && at('#sheet-menu > .keys > *').bottom <= end }",
    ),
    "six reasons of an intervention are in sight on a low phone": (
        "take-over", 360, 640,
        f"() => {{ {RECT} return at('.chip-rows .key:nth-child(6)').bottom <= at('.take-over .mark-keys').top }}",
    ),
    "three are on the smallest": (
        "take-over", 320, 568,
        f"() => {{ {RECT} return at('.chip-rows .key:nth-child(3)').bottom <= at('.take-over .mark-keys').top }}",
    ),
    "all reasons and what is known of an intervention are on a phone on its side": (
        "take-over", 740, 360,
        f"() => {{ {RECT} return at('.take-facts').top >= at('.take-over .mark-head').bottom - 1"
        " && at('.chip-rows .key:nth-child(6)').bottom <= at('.take-over .mark-keys').top }",
    ),
    "a critical alarm cuts no key of a planned stop on a phone on its side": (
        "planned-stop-critical", 740, 360,
        f"() => {{ {RECT} const line = at('.planned-stop').height;"
        " return at('#sheet-alarm').height > 0 && line > 20 && line < 32"
        " && at('[data-f=planned-stop-end]').height === undefined }",
    ),
    "what is known of a silent car is beside the notice at a planned stop": (
        "planned-stop-stale", 740, 360,
        f"() => {{ {RECT} const [text, words] = ['.veil .plate p', '.veil .plate dl'].map(at);"
        " return text.right <= at('.snack').left && words.right <= at('.snack').left"
        " && words.bottom <= at('#monitor > .view').bottom }",
    ),
    "the head of a lost connection leaves its text the room on a small phone on its side": (
        "server-silent", 640, 360,
        f"() => {{ {RECT} return at('#sheet-lost > h2').height < 44 }}",
    ),
    "no car in alarm is behind the edge of the list of cars": (
        "cars",
        1024,
        768,
        "() => { const list = document.querySelector('#sheet-cars > .cars');"
        " return list.clientHeight > 0 && list.scrollHeight <= list.clientHeight + 1 }",
    ),
    "the Mark key gives way to the list of alarms on a phone on its side": (
        "alarms",
        740,
        360,
        "() => document.querySelector('.ledge').hidden",
    ),
    "the slide of a car that is slowed is read whole on a phone on its side": (
        "slow-down-ordered",
        740,
        360,
        "() => { const text = document.querySelector('#monitor > .rail .slide .tx');"
        " return text.clientWidth > 60 && text.scrollHeight <= text.clientHeight }",
    ),
    "the slide that slows the car is read whole on a phone on its side": (
        "slow-down-armed",
        740,
        360,
        "() => { const text = document.querySelector('#monitor > .rail .slide .tx');"
        " return text.textContent.length > 10 && text.scrollHeight <= text.clientHeight }",
    ),
    "so it is under the left thumb": (
        "slow-down-armed",
        740,
        360,
        "() => { document.documentElement.dataset.hand = 'left';"
        " const text = document.querySelector('#monitor > .rail .slide .tx');"
        " return text.textContent.length > 10 && text.scrollHeight <= text.clientHeight }",
    ),
    "Pause is beside the slide, which is read whole, in a narrow window on its side": (
        "slow-down-armed", 700, 360,
        f"() => {{ {RECT} const text = document.querySelector('#monitor > .rail .slide .tx');"
        " return at('#monitor > .rail [data-f=pause]').right < at('#monitor > .rail .slide').left"
        " && text.scrollHeight <= text.clientHeight && text.scrollWidth <= text.clientWidth }",
    ),
    "the row of the Mark key is as wide as the rail within the edge of a paused page": (
        "paused", 740, 360,
        f"() => {{ {RECT} const [row, rail] = [at('#monitor > .ledge'), at('#monitor > .rail')];"
        " return document.documentElement.hasAttribute('data-framed')"
        " && Math.abs(row.left - rail.left) < 1 && Math.abs(row.right - rail.right) < 1 }",
    ),
    "two topics to choose are in sight on a phone on its side, beside the key": (
        "topic", 740, 360,
        f"() => {{ {RECT} return at('#sheet-topic li:nth-child(2)').bottom <= at('#sheet-topic').bottom"
        " && at('#sheet-topic li').right <= at('#sheet-topic .keys').left + 1 }",
    ),
    "what arms is at the foot of a tablet's drawer": (
        "slow-down-arm", 820, 1180,
        f"() => {{ {RECT} return at('#sheet-slow').bottom - at('#sheet-slow [data-act=arm]').bottom < 20 }}",
    ),
    "a failed connection is explained in the column of the connect screen": (
        "connect-failed", 820, 1180,
        f"() => {{ {RECT} return Math.abs(at('#sheet-failed').left - at('#connect .view > *').left) < 2 }}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", ROOM)
async def test_it_is_in_sight(phone: Phone, canned: Canned, what: str) -> None:
    name, width, height, holds = ROOM[what]
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, name)
    await phone.page.wait_for_function(COMPLETE)
    await phone.page.wait_for_function(holds)
