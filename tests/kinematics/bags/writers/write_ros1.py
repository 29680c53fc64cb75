#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The ROS 1 bags, sound and cut, from WORK/content.json (content.py): write_ros1.py WORK DATA

Needs Debian's python3-rosbag (1.15.15), python3-sensor-msgs (1.13.1), python3-std-msgs (0.5.13) and python3-tf2-msgs
(0.7.6). The message definitions have no comments, but for /joint_states in the bz2 bag, to keep the bags small.
"""
import base64
import json
import pathlib
import re
import sys

import genpy
import rosbag


def fill(message, value):
    """Sets the fields of a ROS 1 message from those of the ROS 2 one."""
    types = dict(zip(message.__slots__, message._slot_types))
    for key, item in value.items():
        key = key.upper() if message._type == "sensor_msgs/CameraInfo" and len(key) == 1 else key
        if types[key] == "time":
            item = genpy.Time(item["sec"], item["nanosec"])
        elif types[key] == "uint8[]":
            item = base64.b64decode(item)
        elif isinstance(item, dict):
            item = fill(getattr(message, key), item)
        elif item and isinstance(item, list) and isinstance(item[0], dict):
            item = [fill(genpy.message.get_message_class(types[key][:-2])(), i) for i in item]
        setattr(message, key, item)
    return message


def without_comments(definition):
    lines = (re.sub(r"\s*#.*", "", line) for line in definition.splitlines())
    return "".join(line + "\n" for line in lines if line)


def write(path, content, compression, chunk, commented=()):
    sequences = {}
    with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=chunk) as bag:
        for m in content["messages"]:
            topic, kind = m["topic"], content["types"][m["topic"]].replace("/msg/", "/")
            if kind.startswith("apriltag_msgs"):
                continue
            cls = genpy.message.get_message_class(kind)
            message = fill(cls(), m["value"])
            if hasattr(message, "header"):
                sequences[topic] = message.header.seq = sequences.get(topic, -1) + 1
            text = cls._full_text if topic in commented else without_comments(cls._full_text)
            header = {"topic": topic, "type": kind, "md5sum": cls._md5sum, "message_definition": text}
            if topic == "/tf_static":
                header |= {"callerid": "/camera_mount", "latching": "1"}
            receive = genpy.Time(*divmod(int(m["receive_ns"]), 10**9))
            bag.write(topic, message, receive, connection_header=header)


def main():
    work, data = (pathlib.Path(a) for a in sys.argv[1:3])
    content = json.loads((work / "content.json").read_text())
    write(data / "joints_ros1_none.bag", content, "none", 6000)
    write(data / "joints_ros1_lz4.bag", content, "lz4", 10000)
    write(data / "joints_ros1_bz2.bag", content, "bz2", 20000, ("/joint_states",))

    # Joint states only, cut in the middle of the second chunk.
    joints = [m for m in content["messages"] if m["topic"] == "/joint_states"]
    path = data / "cut.bag"
    write(path, {**content, "messages": joints}, "none", 1500)
    with rosbag.Bag(str(path)) as bag:
        chunks = bag._chunks
    path.write_bytes(path.read_bytes()[:(chunks[1].pos + chunks[2].pos) // 2])
    damaged = json.loads((data / "damaged.json").read_text())
    damaged["cut.bag"] = {"joint_states": sum(chunks[0].connection_counts.values())}
    (data / "damaged.json").write_text(json.dumps(damaged, indent=1) + "\n")


if __name__ == "__main__":
    main()
