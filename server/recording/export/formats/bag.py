"""A recording as ROS 1 bag: ROS 1 messages as they are, those of ROS 2 converted, catgraph's own as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from server.recording.export.bag_file import BagFile, BagTimeOutOfRange, Compression
from server.recording.export.export_format import ExportFormat, ExportRefused, Outcome, Progress, nothing
from server.recording.export.raw import OWN, Raw, explain, in_time, later_messages, raw_messages
from server.recording.export.to_ros1 import Ros1Form, md5sum, ros1_form
from server.recording.read.errors import Undecodable
from server.recording.read.read import Recording
from server.recording.read.source import Channel, FileSource

FORMAT = ExportFormat(
    name="bag",
    label="ROS 1 bag",
    use="for rosbag and rqt",
    extension="bag",
    media_type="application/x-rosbag",
    writer=f"{__name__}:write_bag",
    options=("compression", "with_own"),
    order=10,
)

_STRING_TYPE, _STRING = "std_msgs/String", "string data\n"


def write_bag(
    recording: Recording,
    path: Path,
    *,
    compression: Compression = "none",
    with_own: bool = True,
    progress: Progress = nothing,
) -> Outcome:
    """Writes the bag. catgraph's own channels become std_msgs/String with their JSON, on /catgraph/*.

    Raises ExportRefused where nothing can stand in a bag, RecordingUnreadable, OSError.
    """
    outcome = Outcome()
    forms = _forms(recording, outcome, with_own=with_own)
    if not forms:
        raise ExportRefused("Nothing in this recording fits a ROS 1 bag.")
    later = later_messages(recording) if with_own else []
    forms.update({(raw.file, raw.channel.number): _as_text() for raw in later})
    bag = BagFile(path, compression)
    try:
        _copy(in_time(raw_messages(recording, progress=progress), later), bag, forms, outcome)
        bag.close()
    except BaseException:
        bag.abandon()
        raise
    explain(recording, later, outcome)
    outcome.notes += [f"{sentence}." for sentence in recording.damage]
    return outcome


def _copy(messages: Iterable[Raw], bag: BagFile, forms: dict[tuple[int, int], Ros1Form], outcome: Outcome) -> None:
    numbers: dict[tuple[str, str, str, bool], int] = {}
    ways: dict[tuple[int, int], int] = {}
    unfit: Counter[str] = Counter()
    longer: Counter[str] = Counter()
    why: dict[str, str] = {}

    def number_of(raw: Raw, form: Ros1Form) -> int:
        """Of the connection: one for the same topic and type in several files."""
        channel = raw.channel
        key = (channel.topic, form.type, form.md5sum, channel.is_latched)
        if key not in numbers:
            numbers[key] = bag.add_connection(
                channel.topic, form.type, form.md5sum, form.definition, is_latched=channel.is_latched
            )
        return numbers[key]

    for raw in messages:
        place = (raw.file, raw.channel.number)
        form = forms.get(place)
        if form is None:
            continue
        try:
            data = _converted(raw, form, longer)
            connection = ways.get(place)
            if connection is None:
                connection = ways[place] = number_of(raw, form)
            bag.write(connection, raw.time_ns, data)
        except (Undecodable, BagTimeOutOfRange) as error:
            unfit[raw.channel.topic] += 1
            why.setdefault(raw.channel.topic, str(error))
            continue
        outcome.entries += 1
    outcome.notes += [
        f"{count} messages on {topic} are left out: {why[topic]}." for topic, count in sorted(unfit.items())
    ]
    outcome.notes += [
        f"{count} messages on {topic} have bytes behind their last field: these are left out."
        for topic, count in sorted(longer.items())
    ]


def _converted(raw: Raw, form: Ros1Form, longer: Counter[str]) -> bytes | memoryview:
    """The message in ROS 1. Raises Undecodable. `longer`: counts by topic those of which the end is left out."""
    try:
        return form.convert(raw.data)
    except Undecodable:
        data = form.convert(form.body(raw.data))
    longer[raw.channel.topic] += 1
    return data


def _forms(recording: Recording, outcome: Outcome, *, with_own: bool) -> dict[tuple[int, int], Ros1Form]:
    """File and channel → what it is in the bag; what is nothing there is named."""
    forms: dict[tuple[int, int], Ros1Form] = {}
    known: dict[tuple[str, str, str], Ros1Form] = {}  # making one takes a tenth of a second
    left_out: Counter[tuple[str, str]] = Counter()  # messages by topic and reason
    for file_number, file in enumerate(recording.files):
        for channel in file.channels:
            is_own = channel.topic.startswith(OWN) and channel.encoding == "json"
            if not channel.count or (is_own and not with_own):
                continue
            key = (channel.type, channel.definition, "own" if is_own else channel.encoding)
            try:
                if key not in known:
                    known[key] = _as_text() if is_own else _form(channel, file, outcome)
            except Undecodable as error:
                left_out[channel.topic, str(error)] += channel.count
                continue
            forms[file_number, channel.number] = known[key]
    outcome.notes += [f"{topic} ({count} messages) is left out: {why}." for (topic, why), count in left_out.items()]
    return forms


def _form(channel: Channel, file: FileSource, outcome: Outcome) -> Ros1Form:
    form = ros1_form(channel, file)
    if form.lost:
        outcome.notes.append(f"ROS 1 has no field for {', '.join(form.lost)}: left out of {channel.topic}.")
    return form


def _as_text() -> Ros1Form:
    return Ros1Form(
        type=_STRING_TYPE, definition=_STRING, md5sum=md5sum(_STRING_TYPE, _STRING), convert=_text, body=_text
    )


def _text(raw: bytes) -> bytes:
    return len(raw).to_bytes(4, "little") + raw
