#!/bin/sh
# rosbags 0.11.9 with mcap-ros1-support 0.9.0 (PyPI), which contains genpy, the generator of ROS 1.
#
# What a good engineer would guess: any valid bag of ROS 1 opens. The md5sum of a type is defined by ROS: over its
# definition, constants as they are written there.
#
# What is seen: rosbags computes it over its own spelling of the constants, `1000.0` for `1e3` and `a` for `"a"`. It is
# then another md5sum than that of ROS. `AnyReader` compares the two and refuses the whole bag, with every other topic in
# it, as a "hash mismatch". A bag that rosbags writes with such a type has the wrong md5sum, by which ROS 1 refuses a
# connection. A constant that is written as Python writes it does no harm.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 mcap-ros1-support==0.9.0 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

from mcap_ros1._vendor.genpy.dynamic import generate_dynamic
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPE = "bench_msgs/msg/Drive"
folder = Path(sys.argv[1])


def tried(number, constant):
    """Whether rosbags has the md5sum of ROS, and what comes of a bag that has that of ROS."""
    definition = f"{constant}\nfloat32 speed\n"
    right = generate_dynamic("bench_msgs/Drive", definition)["bench_msgs/Drive"]._md5sum
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, TYPE))
    own = store.generate_msgdef(TYPE)[1]
    path = folder / f"{number}.bag"
    with Writer(path) as writer:  # as `rosbag record` writes it: definition and md5sum are those of the publisher
        drive = writer.add_connection("/drive", TYPE, msgdef=definition, md5sum=right)
        writer.write(drive, 1, store.serialize_ros1(store.types[TYPE](speed=3.0), TYPE))
    try:
        with AnyReader([path]) as reader:
            found = [reader.deserialize(data, one.msgtype).speed for one, _, data in reader.messages()]
    except Exception as error:
        found = f"{type(error).__name__}: {error}"
    return own == right, found


print(f"rosbags {version('rosbags')}, genpy of mcap-ros1-support {version('mcap-ros1-support')}")
results = []
for number, constant in enumerate(("float32 LIMIT=1000.0", "float32 LIMIT=1e3", 'string NAME="a"')):
    is_same, found = tried(number, constant)
    print(f"  {constant}: {'the md5sum of ROS' if is_same else 'another md5sum'}; read: {found}")
    results.append((is_same, str(found)))
holds = results[0] == (True, "[3.0]") and all(not same and "hash mismatch" in found for same, found in results[1:])
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" "$folder" || status=$?
exit "$status"
