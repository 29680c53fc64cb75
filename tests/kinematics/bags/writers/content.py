#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The content of all bags, and the numbers that the tests compare.

    content.py WORK DATA    writes WORK/content.json (for the writers) and DATA/expected.json

Needs Debian's python3-pil (9.4.0) for the compressed images. Run the scripts in this order:

    python3 content.py WORK DATA
    node write_mcap.js WORK DATA
    python3 write_rosbag2.py WORK DATA
    python3 write_ros1.py WORK DATA
"""
import base64
import io
import json
import math
import pathlib
import sys

from PIL import Image

T0 = 1_700_000_000_000_000_000
MS = 1_000_000
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/gripper/joint_states": "sensor_msgs/msg/JointState",
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/compressed": "sensor_msgs/msg/CompressedImage",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/detections": "apriltag_msgs/msg/AprilTagDetectionArray",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/chatter": "std_msgs/msg/String",
}


def stamp(ns):
    return {"sec": ns // 10**9, "nanosec": ns % 10**9}


def received(topic, i, ns):
    """7 ms after the stamp, +/- up to 2 ms, to the microsecond."""
    return ns + 7 * MS + (7919 * (i + 100 * list(TYPES).index(topic)) % 4001 - 2000) * 1000


def joint_states(k):
    names = ["shoulder", "elbow", "slide"]
    values = [
        [0.1 * math.sin(k / 5), 0.2 + 0.01 * k, 0.05 * math.cos(k / 7)],
        [0.01 * k, -0.02 * k, 0.0],
        [1.0 + k, -2.0, 0.5 * k],
    ]
    order = [0, 1, 2] if k < 20 else [2, 0, 1]
    position, velocity, effort = ([v[i] for i in order] for v in values)
    return {"name": [names[i] for i in order], "position": position, "velocity": velocity, "effort": effort}


def gripper(k):
    return {"name": ["finger"], "position": [0.001 * k], "velocity": [], "effort": []}


def image(k):
    """8x6 pixels; the rows of the first have two bytes of padding."""
    encoding, channels, step = [("mono8", 1, 10), ("rgb8", 3, 24), ("bgr8", 3, 24), ("bayer_rggb8", 1, 8)][k]
    data = bytearray()
    for y in range(6):
        row = bytes((20 * x + 30 * y + 60 * c + 7 * k) % 256 for x in range(8) for c in range(channels))
        data += row.ljust(step, b"\xee")
    return {"height": 6, "width": 8, "encoding": encoding, "is_bigendian": 0, "step": step, "data": bytes(data)}


def compressed(k):
    picture = Image.new("L", (16, 12))
    picture.putdata([(10 * x + 8 * y + 20 * k) % 256 for y in range(12) for x in range(16)])
    stream = io.BytesIO()
    picture.save(stream, ["JPEG", "PNG"][k], optimize=True)
    return {"format": ["jpeg", "mono8; png compressed "][k], "data": stream.getvalue()}


def camera_info(_):
    return {
        "height": 6, "width": 8, "distortion_model": "plumb_bob",
        "d": [-0.1, 0.01, 0.001, -0.002, 0.0],
        "k": [500.0, 0.0, 4.0, 0.0, 501.0, 3.0, 0.0, 0.0, 1.0],
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [500.0, 0.0, 4.0, 0.0, 0.0, 501.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0, "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def detections(k):
    def one(i):
        x, y = 2.0 + 3.0 * i + 0.25 * k, 2.5 + 0.125 * i
        corners = [(x - 1, y + 1), (x + 1, y + 1.0625), (x + 1, y - 1), (x - 1, y - 1)]
        return {
            "family": "tag36h11", "id": 3 + 4 * i, "hamming": i, "goodness": 0.5 * i, "decision_margin": 87.25 - 10 * k,
            "centre": {"x": x, "y": y}, "corners": [{"x": a, "y": b} for a, b in corners],
            "homography": [1.0, 0.001 * k, x, -0.001 * k, 1.0, y, 0.0, 0.0, 1.0],
        }
    return {"detections": [one(0), one(1)]}


def messages():
    """(topic, index, header stamp, frame, fields) of every message that has a header of its own."""
    plan = (
        ("/joint_states", 40, 0, 20, "", joint_states),
        ("/gripper/joint_states", 10, 0, 80, "", gripper),
        ("/camera/image_raw", 4, 100, 200, "camera_optical", image),
        ("/camera/compressed", 2, 200, 200, "camera_optical", compressed),
        ("/camera/camera_info", 4, 100, 200, "camera_optical", camera_info),
        ("/detections", 2, 100, 200, "camera_optical", detections),
    )
    for topic, count, first, period, frame, make in plan:
        for k in range(count):
            ns = T0 + (first + period * k) * MS
            value = {"header": {"stamp": stamp(ns), "frame_id": frame}, **make(k)}
            yield {"topic": topic, "receive_ns": received(topic, k, ns), "stamp_ns": ns, "value": value}
    half = math.sqrt(0.5)
    transform = {
        "header": {"stamp": stamp(T0), "frame_id": "base_link"}, "child_frame_id": "camera_optical",
        "transform": {"translation": {"x": 0.5, "y": -0.25, "z": 1.25},
                      "rotation": {"x": -half, "y": 0.0, "z": 0.0, "w": half}},
    }
    yield {"topic": "/tf_static", "receive_ns": received("/tf_static", 0, T0), "stamp_ns": T0,
           "value": {"transforms": [transform]}}
    for k in range(3):
        ns = T0 + (150 + 250 * k) * MS
        yield {"topic": "/chatter", "receive_ns": ns, "stamp_ns": ns, "value": {"data": f"hello {k}"}}


def expected(message):
    """As in the bag; times are strings, pixels a list, and a compressed image is what it decodes to (PNG only)."""
    value = {k: v for k, v in message["value"].items() if k != "header"}
    if message["topic"] == "/camera/image_raw":
        value["data"] = list(value["data"])
    if message["topic"] == "/camera/compressed":
        picture = Image.open(io.BytesIO(value["data"]))
        value |= {"data_size": len(value.pop("data")), "width": picture.width, "height": picture.height}
        if picture.format == "PNG":
            value["grey"] = list(picture.getdata())
    times = {"receive_ns": str(message["receive_ns"])}
    if "header" in message["value"]:
        times |= {"stamp_ns": str(message["stamp_ns"]), "frame_id": message["value"]["header"]["frame_id"]}
    return times | value


def main():
    work, data = (pathlib.Path(a) for a in sys.argv[1:3])
    bag = sorted(messages(), key=lambda m: m["receive_ns"])
    assert len({m["receive_ns"] for m in bag}) == len(bag)
    blocks = []
    for topic, kind in TYPES.items():
        lines = [json.dumps(expected(m), separators=(",", ":")) for m in bag if m["topic"] == topic]
        blocks.append(f'"{topic}": {{"type": "{kind}", "messages": [\n' + ",\n".join(lines) + "\n]}")
    (data / "expected.json").write_text('{"topics": {\n' + ",\n".join(blocks) + "\n}}\n")
    for message in bag:  # a JSON number may be read as a double
        message |= {key: str(message[key]) for key in ("receive_ns", "stamp_ns")}
    coded = json.dumps({"types": TYPES, "messages": bag}, default=lambda b: base64.b64encode(b).decode())
    (work / "content.json").write_text(coded)


if __name__ == "__main__":
    main()
