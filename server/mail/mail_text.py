"""The generated text of a mail: attachments, how to join parts, links."""

from __future__ import annotations

from collections.abc import Sequence

from server.mail.order import Format
from server.mail.pack import Pack, Stretch

FORMATS: dict[Format, str] = {
    "mcap": "recorded (MCAP opens in Foxglove and Lichtblick)",
    "bag": "ROS 1 bag (rosbag, rqt_bag)",
    "csv": "CSV tables",
    "html": "HTML report",
}


def subject_of(subject: str, part: int, parts: int) -> str:
    return f"{subject} ({part}/{parts})" if parts > 1 else subject


MOST_MISSING = 30  # sentences of what is not in the files


def attached(
    text: str,
    recordings: Sequence[str],
    format: Format,
    pack: Pack,
    parts: Sequence[Stretch],
    missing: Sequence[str] = (),
    heads: Sequence[str] = (),
) -> list[str]:
    """The text of each mail. `missing`: what of the recordings is not in the files, a sentence each; `heads`: of hash
    chains, a line each."""
    what = _joined(f"{_recordings(recordings)} as {FORMATS[format]}.", _missing(missing), _heads(heads))
    sum_ = f"SHA-256 of {pack.name}: {pack.sha256}"
    if len(parts) == 1:
        return [_joined(text, what, f"Attached: {pack.name}, {_size(pack.size_bytes)}.", sum_)]
    first, last = parts[0].name, parts[-1].name
    join = (
        f"Save all {len(parts)} parts, {first} to {last}, in one folder; the mails may come in any order.\n"
        f"With 7-Zip open {first}, which joins them; on Linux or macOS: cat {pack.name}.* > {pack.name}\n"
        f"On Windows without 7-Zip: copy /b {'+'.join(one.name for one in parts[:3])}"
        f"{'+…' if len(parts) > 3 else ''} {pack.name}"
    )
    return [
        _joined(
            text,
            what,
            f"Attached: {one.name}, {_size(one.length)}: part {number} of {len(parts)} of {pack.name}, "
            f"{_size(pack.size_bytes)} in all.",
            join,
            sum_,
        )
        for number, one in enumerate(parts, 1)
    ]


def linked(
    text: str,
    recordings: Sequence[str],
    format: Format,
    pack: Pack,
    links: Sequence[str],
    missing: Sequence[str] = (),
    heads: Sequence[str] = (),
) -> str:
    """The text of a mail with links in place of an attachment."""
    what = f"{_recordings(recordings)} as {FORMATS[format]}: {_size(pack.size_bytes)}, too large to be attached."
    many = "Each link is" if len(links) > 1 else "The link is"
    note = f"{many} one to catgraph's own server: it works while that runs, and where its network can be reached."
    return _joined(text, what, _missing(missing), _heads(heads), "\n".join(links), note)


def _missing(sentences: Sequence[str]) -> str:
    if not sentences:
        return ""
    more = len(sentences) - MOST_MISSING
    lines = [f"- {one}" for one in sentences[:MOST_MISSING]] + ([f"- and {more} more."] if more > 0 else [])
    return "\n".join(["Not all of the recording is in the file:", *lines])


def _heads(lines: Sequence[str]) -> str:
    """The heads of the hash chains, to compare with the report and with the output of `catgraph verify`."""
    return "\n".join(["Head of the hash chain of each recording:", *lines]) if lines else ""


def _recordings(recordings: Sequence[str]) -> str:
    if len(recordings) == 1:
        return f"Recording {recordings[0]}"
    return f"{len(recordings)} recordings ({', '.join(recordings)})"


def _joined(*paragraphs: str) -> str:
    return "\n\n".join(paragraph for paragraph in paragraphs if paragraph.strip())


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 100_000 else f"{size_bytes / 1e3:.1f} kB"
