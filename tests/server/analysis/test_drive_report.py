"""The drive's report as a page, as JSON, as a table, and in an authority's columns."""

from __future__ import annotations

import csv
import html
import io
import json
import re
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import pytest

from server.analysis.drive import form, sheet, sheet_things
from server.analysis.drive.axis import nice_step, ticks, time_ticks
from server.analysis.drive.drive_report import write_drive_page
from server.analysis.drive.form import write_forms
from server.analysis.drive.tables import write_report_csv, write_report_json
from server.analysis.page import whole
from server.recording.catalog import annotations
from server.recording.drive.departure import Departure
from server.recording.export.export_format import ExportRefused
from server.recording.marks.media import MediaName
from server.recording.read.read import open_recording
from tests.server.recording.drive.story import EVIL, PHOTO, in_two_parts, logged, recorded
from tests.server.recording.drive.test_facts import BEGIN_MS
from tests.tree import PROJECT


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive with everything, and all that is written of it."""
    folder = tmp_path_factory.mktemp("report")
    path = recorded(folder)
    annotations.write(path, annotations.Annotations(note=EVIL, weather="dry, 21 °C", tags=(EVIL[:30],)))
    late = path.with_name(path.name + ".marks")
    late.mkdir()
    (late / "m1.photo.png").write_bytes(PHOTO)
    (late / "m3.voice.webm").write_bytes(b"\x1a\x45\xdf\xa3" + bytes(90))
    (late / "m3.voice.exe").write_bytes(b"MZ")
    with open_recording([path]) as recording:
        write_drive_page(recording, folder / "page.html", name="drive")
        write_report_json(recording, folder / "report.json", name="drive")
        write_report_csv(recording, folder / "report.csv", name="drive")
        write_forms(recording, folder / "forms.zip", name="drive")
    return folder


def test_no_line_breaks_between_a_number_and_its_unit(folder: Path) -> None:
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "9.3\N{NO-BREAK SPACE}m/s" in page
    kept = "2.0 in 10~min, 5 more, 3~m/s² of 4~m".replace("~", "\N{NO-BREAK SPACE}")
    assert whole("2.0 in 10 min, 5 more, 3 m/s² of 4 m") == kept


def test_the_page_shows_all_of_it(folder: Path) -> None:
    text = re.sub(r"<style>.*?</style>|<script.*?</script>", "", (folder / "page.html").read_text(), flags=re.S)
    plain = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())
    for expected in (
        *(
            "Drive report",
            "Intact: 3 records",
            "1.20",
            "0.70",
            "58 % of the distance",
            "1.43 per autonomous km",
            "p90 4.6 s",
        ),
        *(
            "dry, 21 °C",
            "signed 22:13:26, A. K. (Pixel)",
            "2 of 3 done",
            "0.02 s had failed, fixed set again",
            "in control",
        ),
        *("22:13:40", "12.5 m/s, limit 11.0 m/s", "2.1 s", "22:13:53", "22:14:40", "Change to manual, by the driver"),
        *("22:14:55", "The car slows: 10.0 to 8.2 m/s.", "1.4 s", "in 1 gap", "alarms then: signal_slow.scan"),
    ):
        assert expected in plain, expected
    assert "data:image/png;base64," in text
    assert "data:audio/webm;base64," in text


def test_a_figure_above_its_benchmark_has_a_sign(folder: Path, tmp_path: Path) -> None:
    def signed(path: Path) -> list[str]:
        found = re.findall(r"<dt>([^<]+)<svg[^>]+aria-label=\"above the benchmark\"", path.read_text())
        return [title.strip() for title in found]

    assert signed(folder / "page.html") == ["Alarms"]
    assert '<th scope="row" class="b">Alarms in 10 min, mean</th>' in (folder / "page.html").read_text()
    with open_recording([recorded(tmp_path, [])]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
    assert signed(tmp_path / "page.html") == []


def test_hostile_words_are_text(folder: Path) -> None:
    text = (folder / "page.html").read_text()
    assert EVIL not in text
    assert "<img src=x" not in text
    assert text.count(html.escape(EVIL, quote=True)) + text.count("&lt;img src=x") >= 4  # note, item, mark, description
    assert 'style="' not in text.partition("</style>")[2]  # the policy of the page would refuse it


def test_json_and_csv_say_the_same(folder: Path) -> None:
    found = json.loads((folder / "report.json").read_text())
    assert (found["marks"][0]["at_s"], found["interventions"][0]["at_s"]) == (33.33, 80.0)
    assert (found["weather"], found["remarks"]) == ("dry, 21 °C", EVIL)
    assert found["link_delay"] == {"median_s": 0.079, "p90_s": 0.119, "most_s": 0.119}
    assert found["speed_limits"] == [{"from_s": 0.0, "max_mps": 3.0}]
    rows = list(csv.reader(io.StringIO((folder / "report.csv").read_text(encoding="utf-8"), newline="")))
    assert {len(row) for row in rows} == {8}
    assert ["mark", "2023-11-14T22:13:53.330000Z", "", "object", EVIL, "", "A. K. (Pixel)", "m1"] in rows


def test_a_planned_stop_is_in_it_with_its_times_its_reason_and_who(tmp_path: Path) -> None:
    own = [
        logged(10.0, "planned_stop", reason="workshop", by=EVIL),
        logged(12.0, "raised", "gps_drift", text="0.4 m", state="UNACKED", planned_stop="workshop"),
        logged(13.0, "shelved", "gps_drift", state="SHELVED"),
        logged(70.0, "planned_stop_ended", reason="workshop", text="The planned stop ended.", by="M. R. (Tablet)"),
        logged(100.0, "planned_stop", reason="parked", by="M. R. (Tablet)"),
    ]
    with open_recording([recorded(tmp_path, own)]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
        write_report_csv(recording, tmp_path / "report.csv", name="drive")
    text = (tmp_path / "page.html").read_text()
    assert EVIL not in text
    plain = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())
    ended = "The planned stop ended. By M. R. (Tablet)."
    for expected in (
        f"22:13:30 In the workshop, by {EVIL} {ended} 60.0 s",
        "22:15:00 Parked, by M. R. (Tablet) it was in force to the end 20.0 s",
        "planned stop · shelved · 0.4 m",
    ):
        assert " ".join(expected.split()) in plain, expected
    rows = list(csv.reader(io.StringIO((tmp_path / "report.csv").read_text(encoding="utf-8"), newline="")))
    assert [row[7] for row in rows if row[0] == "alarm"] == ["0.4 m · planned stop · shelved"]
    stops = [row for row in rows if row[0] == "planned stop"]
    assert [row[3:] for row in stops] == [
        ["in the workshop", "", "", EVIL, ended],
        ["parked", "", "", "M. R. (Tablet)", ""],
    ]
    assert [row[2] for row in stops] == ["2023-11-14T22:14:30.000000Z", ""]


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a drive of two parts."""
    folder = tmp_path_factory.mktemp("parts")
    paths = in_two_parts(folder)
    annotations.write(paths[0], annotations.Annotations(note="first", weather="dry", tags=("a",)))
    annotations.write(paths[1], annotations.Annotations(note="second", weather="dry", tags=("a", "b")))
    with open_recording(paths) as recording:
        write_drive_page(recording, folder / "page.html", name="drive")
        write_report_json(recording, folder / "report.json", name="drive")
        write_report_csv(recording, folder / "report.csv", name="drive")
    return folder


def test_a_drive_of_several_parts_is_one_report(parts: Path) -> None:
    plain = text_of(parts / "page.html")
    for expected in (
        *("in 2 parts", "Parts of the drive", "Part 1, s1", "Part 2, s1_p2", "1.80 km 3:00 min"),
        "22:15:20 Not recorded the car was 300 m away after it; not counted as driven 30.0 s",
        "in 1 gap, and 30.0 s not recorded",
        *("in the second part", "described later", "2.22 per autonomous km"),
    ):
        assert expected in plain, expected
    assert plain.count("Intact, head ") == 2
    found = json.loads((parts / "report.json").read_text())
    assert [(one["recording"], one["part"]) for one in found["parts"]] == [("s1", 1), ("s1_p2", 2)]
    assert found["gaps"] == [{"from_s": 120.0, "to_s": 150.0, "apart_m": pytest.approx(300, abs=3)}]
    assert (found["weather"], found["remarks"], found["tags"]) == ("dry", "first\nsecond", ["a", "b"])
    assert (found["figures"]["driven_s"], found["load"]["announced"], found["part"]) == (180.0, 4, None)
    rows = list(csv.reader(io.StringIO((parts / "report.csv").read_text(encoding="utf-8"), newline="")))
    assert [row[3] for row in rows if row[0] == "part"] == ["s1", "s1_p2"]
    (gap,) = [row for row in rows if row[0] == "not recorded"]
    assert gap[1:3] == ["2023-11-14T22:15:20.000000Z", "2023-11-14T22:15:50.000000Z"]


def test_rates_curve_and_link_are_in_it(parts: Path) -> None:
    text = (parts / "page.html").read_text()
    assert "Speed in the 10 s before it" in text
    assert "Delay of the link over the distance driven" in text
    assert "2.22 per autonomous km" in text_of(parts / "page.html")
    found = json.loads((parts / "report.json").read_text())
    rates = [found["figures"][name] for name in ("interventions_per_autonomous_km", "alarms_per_km")]
    assert rates == [pytest.approx(2 / 0.9, abs=0.005), pytest.approx(4 / 1.8, abs=0.005)]
    assert [found["link_along"][0][name] for name in ("from_m", "to_m", "blind_s")] == [0.0, 50.0, 0.0]
    rows = list(csv.reader(io.StringIO((parts / "report.csv").read_text(encoding="utf-8"), newline="")))
    along = [row for row in rows if row[0] == "link along the way"]
    assert (along[0][3], along[0][5], len(along)) == ("0 to 50 m", "s of delay", len(found["link_along"]))
    assert 0.020 <= float(along[0][4]) <= 0.025
    assert [row[4] for row in rows if row[3] == "interventions_per_autonomous_km"] == [str(rates[0])]


def test_a_part_that_is_missing_is_said(tmp_path: Path) -> None:
    with open_recording(in_two_parts(tmp_path)[1:]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
    plain = text_of(tmp_path / "page.html")
    assert "Part 1 of the drive of s1_p2 is not in this report" in plain
    assert "in 0 gaps, and 1 part missing" in plain
    bad = re.findall(r'<p class="bad">.*?<b>(.*?)</b>', (tmp_path / "page.html").read_text())
    assert bad == ["Missing: part 1"]


@pytest.mark.parametrize("where", ["car/s1_p3.mcap.writing", "car/s1_p3.mcap.damaged", ".trash/5/car/s1_p3.mcap"])
def test_the_last_part_is_named_while_its_file_is_there(tmp_path: Path, where: str) -> None:
    (tmp_path / "car").mkdir()
    paths = in_two_parts(tmp_path / "car")
    (tmp_path / where).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / where).write_bytes(b"")
    with open_recording(paths) as recording:
        write_report_json(recording, tmp_path / "report.json", name="drive")
        outcome = write_forms(recording, tmp_path / "forms.zip")
    (missing,) = json.loads((tmp_path / "report.json").read_text())["parts_missing"]
    what = "No record here" if where.endswith(".damaged") else "Not in this report"
    assert missing.startswith(f"{what} from 22:16:50 on: Part 3 of the drive of s1 is not in this report")
    assert missing in outcome.notices


def test_a_time_without_a_record_is_never_said_to_be_without_alarms(tmp_path: Path) -> None:
    own: dict[str, Any] = {"length_s": 10.0, "session": "s1"}
    first = recorded(tmp_path, [], name="s1.mcap", **own)
    third = recorded(tmp_path, [], name="s1_p3.mcap", from_s=48.0, part="3", **own)
    with open_recording([first, third]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
        write_report_json(recording, tmp_path / "report.json", name="drive")
        write_report_csv(recording, tmp_path / "report.csv", name="drive")
    text = text_of(tmp_path / "page.html")
    assert "Alarms, time to acknowledge none in what was recorded" in text
    assert "Missing: part 2 see data lost" in text, "no chain that is intact stands alone"
    assert "in 0 gaps, and 38.0 s not recorded, 1 part missing" in text
    bad = re.findall(r'<p class="bad">.*?<b>(.*?)</b>', (tmp_path / "page.html").read_text())
    assert bad == ["Missing: part 2"], "the lines of the parts that are intact are no alarm"
    assert "No record here from 22:13:30 to 22:14:08: whether there were alarms is not known." in text
    assert "No record here from 22:13:30 to 22:14:08: Part 2 of the drive of s1 is not in this report" in text
    (one,) = json.loads((tmp_path / "report.json").read_text())["no_record"]
    assert (one["from_ms"] - BEGIN_MS, one["to_ms"] - BEGIN_MS, one["parts"]) == (10_000, 48_000, [2])
    rows = list(csv.reader(io.StringIO((tmp_path / "report.csv").read_text(encoding="utf-8"), newline="")))
    (row,) = (row for row in rows if row[0] == "no record here")
    assert row[1:3] == ["2023-11-14T22:13:30.000000Z", "2023-11-14T22:14:08.000000Z"]
    (tmp_path / "alone").mkdir()
    alone = recorded(tmp_path / "alone", [], name="s1.mcap", **own)
    with open_recording([alone]) as recording:
        write_drive_page(recording, tmp_path / "whole.html", name="drive")
    text = text_of(tmp_path / "whole.html")
    assert "Alarms, time to acknowledge none" in text
    assert "No record" not in text


def text_of(path: Path) -> str:
    """The text of the page, without its tags."""
    text = re.sub(r"<style>.*?</style>|<script.*?</script>", "", path.read_text(), flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def test_the_authority_gets_its_columns(folder: Path) -> None:
    with zipfile.ZipFile(folder / "forms.zip") as packed:
        tables = {name: list(csv.reader(io.StringIO(packed.read(name).decode()))) for name in packed.namelist()}
    heads, row = tables["california-disengagements.csv"]
    assert (len(heads), row[2], row[6]) == (9, "11/14/2023", "Test Driver")
    assert row[8] == f"object late. {EVIL}"
    heads, row = tables["california-mileage.csv"]
    by_month = dict(zip(heads, row, strict=True))
    assert (by_month["NOV"], by_month["DEC"], by_month["ANNUAL TOTAL"]) == ("0.43", "", "0.43")
    assert by_month["Annual Total of Disengagements"] == "1"


def test_a_template_beside_it(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other.toml").write_text(
        'title = "T"\n[[table]]\nfile = "mine"\nrows = "drive"\ncolumns = [{ title = "=cmd", value = "marks" }]\n'
    )
    monkeypatch.setenv(form.FOLDER, str(tmp_path))
    with open_recording([folder / "ours.mcap"]) as recording:
        write_forms(recording, tmp_path / "out.zip", name="drive")
    with zipfile.ZipFile(tmp_path / "out.zip") as packed:
        assert packed.read("mine.csv").decode() == "'=cmd\r\n2\r\n"


def test_a_template_may_have_each_field_that_the_guide_names() -> None:
    guide = (PROJECT / "docs" / "guide" / "report.md").read_text()
    for rows, line in (("interventions", "Fields of an intervention: "), ("drive", "Fields of a drive: ")):
        listed = re.findall(r"`(\w+)`", next(one for one in guide.splitlines() if one.startswith(line)))
        columns = ", ".join(f'{{ title = "{name}", value = "{name}" }}' for name in listed)
        text = f'title = "T"\n[[table]]\nfile = "x"\nrows = "{rows}"\ncolumns = [{columns}]'
        assert len(form.read_form(text.encode(), "all.toml").table[0].columns) == len(listed) > 10


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(b"title = 3", id="no title"),
        pytest.param(b"\xff\xfe", id="no text"),
        pytest.param(
            b'title = "T"\n[[table]]\nfile = "../x"\nrows = "drive"\ncolumns = [{ title = "a" }]', id="a way out"
        ),
        pytest.param(b'title = "T"\n[[table]]\nfile = "x"\nrows = "all"\ncolumns = [{ title = "a" }]', id="other rows"),
        pytest.param(
            b'title = "T"\n[[table]]\nfile = "x"\nrows = "drive"\ncolumns = [{ title = "km", value = "distance_x" }]',
            id="no such field of a drive",
        ),
        pytest.param(
            b'title = "T"\n[[table]]\nfile = "x"\nrows = "interventions"\n'
            b'columns = [{ title = "km", value = "distance_m" }]',
            id="a field of other rows",
        ),
        pytest.param(b"#" * (form.MAX_BYTES + 1), id="too long"),
    ],
)
def test_a_template_that_cannot_be_used_is_named(text: bytes) -> None:
    with pytest.raises(ExportRefused, match=r"The template bad\.toml cannot be used: "):
        form.read_form(text, "bad.toml")


@pytest.mark.parametrize("name", ["catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap"])
def test_a_real_drive_says_what_it_does_not_know(name: str, recordings: Path, tmp_path: Path) -> None:
    with open_recording([recordings / name]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
        write_report_json(recording, tmp_path / "report.json", name="drive")
    text = (tmp_path / "page.html").read_text()
    article = text[text.index('<article class="drive"') : text.index("</article>")]
    assert article.count("not known") >= 12
    assert "No departure check was made." not in article  # nobody knows
    found = json.loads((tmp_path / "report.json").read_text())
    unknown = ("people", "departure", "modes", "alarms", "marks", "interventions", "slow_downs", "load", "link_delay")
    assert {name: found[name] for name in unknown} == dict.fromkeys(unknown)
    assert 70 < found["figures"]["distance_m"] < 80
    assert found["start_ms"] < BEGIN_MS


@pytest.mark.parametrize(
    ("state", "counts", "rows"),
    [
        ("signed", (2, 0, 1), [("ok", "2 of 3 done", "")]),
        ("open", (3, 0, 0), [("unknown", "3 of 3 done", "")]),
        ("open", (1, 1, 0), [("critical", "1 of 3 done", "1 failed"), ("unknown", "1 open", "")]),
    ],
    ids=["signed", "not-signed", "failed"],
)
def test_only_a_signed_check_has_a_tick(
    state: Literal["open", "signed"], counts: tuple[int, int, int], rows: list[tuple[str, str, str]]
) -> None:
    done, failed, not_applicable = counts
    check = Departure(state=state, done=done, failed=failed, not_applicable=not_applicable, of=3)
    assert sheet._departure(asdict(check)) == rows


def test_a_drive_without_a_departure_check_says_so(tmp_path: Path) -> None:
    with open_recording([recorded(tmp_path, [logged(1.0, "connected")])]) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
    assert "Departure check No departure check was made." in text_of(tmp_path / "page.html")


def test_media_are_bounded() -> None:
    found = sheet_things.Media()
    found.add(MediaName(mark="a", kind="photo", ending="png"), bytes(sheet_things.MOST_MEDIA_BYTES + 1))
    found.add(MediaName(mark="b", kind="photo", ending="png"), b"x")
    found.add(MediaName(mark="b", kind="photo", ending="png"), b"another")
    assert (found.left_out, found.get("a", "photo")) == (1, None)
    assert found.get("b", "photo") == "data:image/png;base64,eA=="


def test_axes_are_round() -> None:
    assert ticks(0, 12.5, 3) == [0, 5, 10, 15]
    assert nice_step(0, 3) == 1
    assert [name for _, name in time_ticks(BEGIN_MS, BEGIN_MS + 120_000, 4)] == [
        "22:13:30",
        "22:14:00",
        "22:14:30",
        "22:15:00",
    ]
