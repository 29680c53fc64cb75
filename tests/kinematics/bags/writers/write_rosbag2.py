#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The sqlite3 bags and the metadata.yaml files from WORK/cdr.json (write_mcap.js): write_rosbag2.py WORK DATA

Needs python's sqlite3 (SQLite 3.40.1) and Debian's python3-zstandard (0.20.0). Each bag has the layout of another
release of rosbag2: joints_sqlite3 that of Galactic, joints_sqlite3_zstd_message that of Humble, the others that of
Jazzy. To keep them small the databases have pages of 1024 bytes; the one that is compressed as a file has the usual
ones of 4096.
"""
import base64
import json
import pathlib
import sqlite3
import sys

import zstandard

TABLES = {
    "schema": "schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL",
    "metadata": "id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL",
    "topics": "id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,"
              "offered_qos_profiles TEXT NOT NULL",
    "message_definitions": "id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,"
                           "encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL",
    "messages": "id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL",
}
# Release: version of metadata.yaml, of the tables (0: before they had one).
RELEASES = {"galactic": (4, 0), "humble": (5, 3), "jazzy": (9, 4)}


def qos_jazzy(indent):
    forever = ":\n    sec: 9223372036\n    nsec: 854775807\n"
    text = ("- history: unknown\n  depth: 0\n  reliability: reliable\n  durability: volatile\n  deadline" + forever
            + "  lifespan" + forever + "  liveliness: automatic\n  liveliness_lease_duration" + forever
            + "  avoid_ros_namespace_conventions: false")
    return text.replace("\n", "\n" + indent)


def metadata(cdr, release, storage, files, compression=("", "")):
    """metadata.yaml; files are (path in relative_file_paths, path in files, messages)."""
    version = RELEASES[release][0]
    quoted = [c or '""' for c in compression]
    messages = [m for _, _, part in files for m in part]

    def span(part, indent):
        first, last = part[0][1], part[-1][1]
        return (f"{indent}starting_time:\n{indent}  nanoseconds_since_epoch: {first}\n",
                f"{indent}duration:\n{indent}  nanoseconds: {last - first}\n")

    start, duration = span(messages, "  ")
    paths = "  relative_file_paths:\n" + "".join(f"    - {path}\n" for path, _, _ in files)
    text = f"rosbag2_bagfile_information:\n  version: {version}\n  storage_identifier: {storage}\n"
    text += (paths if version == 4 else "") + duration + start + f"  message_count: {len(messages)}\n"
    text += "  topics_with_message_count:\n"
    for topic, kind in cdr["types"].items():
        count = sum(m[0] == topic for m in messages)
        text += f"    - topic_metadata:\n        name: {topic}\n        type: {kind}\n"
        text += "        serialization_format: cdr\n"
        if topic != "/joint_states" or release == "galactic":
            text += "        offered_qos_profiles: " + ("[]" if version == 9 else '""') + "\n"
        elif version == 9:
            text += "        offered_qos_profiles:\n          " + qos_jazzy(" " * 10) + "\n"
        else:
            text += f"        offered_qos_profiles: {json.dumps(cdr['qos'])}\n"
        text += ('        type_description_hash: ""\n' if version == 9 else "") + f"      message_count: {count}\n"
    text += f"  compression_format: {quoted[0]}\n  compression_mode: {quoted[1]}\n"
    if version > 4:
        text += paths + "  files:\n"
        for _, path, part in files:
            text += f"    - path: {path}\n" + "".join(span(part, "      ")) + f"      message_count: {len(part)}\n"
    return text + ("  custom_data: ~\n  ros_distro: jazzy\n" if version == 9 else "")


def database(path, cdr, release, messages, page_size, yaml=""):
    path.unlink(missing_ok=True)
    db = sqlite3.connect(path)
    db.execute(f"PRAGMA page_size = {page_size}")
    version, layout = RELEASES[release]
    tables = [t for t in TABLES if layout or t in ("topics", "messages")]
    tables = [t for t in tables if layout == 4 or t != "message_definitions"]
    for table in tables:
        extra = ",type_description_hash TEXT NOT NULL" if table == "topics" and layout == 4 else ""
        db.execute(f"CREATE TABLE {table}({TABLES[table]}{extra})")
    db.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    if layout:
        db.execute("INSERT INTO schema VALUES (?, ?)", (layout, release))
    ids = {}
    for topic, kind in cdr["types"].items():
        qos = "" if topic != "/joint_states" or not layout else qos_jazzy("") if layout == 4 else cdr["qos"]
        row = (len(ids) + 1, topic, kind, "cdr", qos) + (("",) if layout == 4 else ())
        db.execute(f"INSERT INTO topics VALUES ({','.join('?' * len(row))})", row)
        ids[topic] = row[0]
    if layout == 4:
        for kind, text in cdr["schemas"].items():
            db.execute("INSERT INTO message_definitions VALUES (NULL, ?, 'ros2msg', ?, '')", (kind, text))
    for topic, receive, data in messages:
        db.execute("INSERT INTO messages (timestamp, topic_id, data) VALUES (?, ?, ?)", (receive, ids[topic], data))
    if layout:
        db.execute("INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)", (version, yaml))
    db.commit()
    db.close()


def main():
    work, data = (pathlib.Path(a) for a in sys.argv[1:3])
    cdr = json.loads((work / "cdr.json").read_text())
    messages = [(topic, int(receive), base64.b64decode(text)) for topic, receive, text in cdr["messages"]]
    compressor = zstandard.ZstdCompressor(level=1)

    def folder(name, yaml):
        (data / name).mkdir(exist_ok=True)
        (data / name / "metadata.yaml").write_text(yaml)
        return data / name

    half = len(messages) // 2
    parts = [(f"joints_sqlite3_{i}.db3", "", part) for i, part in enumerate((messages[:half], messages[half:]))]
    bag = folder("joints_sqlite3", metadata(cdr, "galactic", "sqlite3", parts))
    for path, _, part in parts:
        database(bag / path, cdr, "galactic", part, 1024)

    file = "joints_mcap_folder_0.mcap"
    folder("joints_mcap_folder", metadata(cdr, "jazzy", "mcap", [(file, file, messages)]))

    # rosbag2 leaves the name of the file before its compression in "files".
    file = "joints_sqlite3_zstd_file_0.db3"
    yaml = metadata(cdr, "jazzy", "sqlite3", [(file + ".zstd", file, messages)], ("zstd", "FILE"))
    bag = folder("joints_sqlite3_zstd_file", yaml)
    database(work / file, cdr, "jazzy", messages, 4096, yaml)
    (bag / (file + ".zstd")).write_bytes(compressor.compress((work / file).read_bytes()))

    file = "joints_sqlite3_zstd_message_0.db3"
    yaml = metadata(cdr, "humble", "sqlite3", [(file, file, messages)], ("zstd", "MESSAGE"))
    bag = folder("joints_sqlite3_zstd_message", yaml)
    packed = [(topic, receive, compressor.compress(text)) for topic, receive, text in messages]
    database(bag / file, cdr, "humble", packed, 1024, yaml)


if __name__ == "__main__":
    main()
