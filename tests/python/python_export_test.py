# SPDX-License-Identifier: Apache-2.0
"""What `kinescope export` writes of a run, read by readers of its own: the formats' public texts and NumPy alone."""

import csv
import ctypes
import ctypes.util
import json
import struct
import unittest
import xml.etree.ElementTree as xml
import zlib

import numpy as np

import kinescope
from program import SCARA, run_of_sample, scratch
from python_run_test import forward_of_urdf, read_csv

SAME = 1e-9  # m, and of rotation matrices


def rotation_of_quaternion(x, y, z, w):
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose_of(x, y, z, qx, qy, qz, qw):
    T = np.eye(4)
    T[:3, :3] = rotation_of_quaternion(qx, qy, qz, qw)
    T[:3, 3] = x, y, z
    return T


def shift(axis, by):
    T = np.eye(4)
    T[axis, 3] = by
    return T


def turn(axis, by):
    T, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    T[i, i] = T[j, j] = np.cos(by)
    T[j, i], T[i, j] = np.sin(by), -np.sin(by)
    return T


def forward_of_table(path, convention, values):
    """T_base_tip of every chain, from the table alone."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    out = {}
    for row in rows:
        T = out.setdefault(row["chain"], np.eye(4))
        if row["type"] in ("base", "tool"):
            step = pose_of(*(float(row[k]) for k in ("x", "y", "z", "qx", "qy", "qz", "qw")))
        else:
            a, alpha, beta, theta, d = (float(row[k]) for k in ("a", "alpha", "beta", "theta", "d"))
            q = values[row["row"]]
            turns = row["type"] == "revolute"
            about = turn(2, theta + q * turns) @ shift(2, d + q * (not turns))
            between = shift(0, a) @ turn(0, alpha) @ turn(1, beta)
            step = about @ between if convention == "standard" else between @ about
        out[row["chain"]] = T @ step
    return out


class Trajectories(unittest.TestCase):
    def test_are_the_forward_kinematics_of_the_urdf(self):
        _, folder = run_of_sample()
        told = kinescope.export(folder, tum=scratch() / "tum")["tum"]
        values = read_csv(folder / "joint_values.csv")
        self.assertEqual(len(told["paths"]), 4)
        for link, one in told["paths"].items():
            path = np.loadtxt(scratch() / "tum" / one["file"])  # '#' begins a comment
            self.assertEqual(path.shape, (len(values), 8))
            self.assertEqual(path.shape[0], one["poses"])
            np.testing.assert_allclose(np.linalg.norm(path[:, 4:], axis=1), 1, atol=1e-12)
            for row, joints in list(zip(path, values, strict=True))[::7]:
                q = {name: float(value) for name, value in joints.items()}
                self.assertEqual(row[0], q.pop("t"))
                expected = forward_of_urdf(folder / "robot.urdf", q)[link]
                np.testing.assert_allclose(pose_of(*row[1:]), expected, atol=SAME)


def moving_joints(urdf):
    joints = xml.parse(urdf).getroot().findall("joint")
    return [joint.get("name") for joint in joints if joint.get("type") != "fixed"]


class DenavitHartenberg(unittest.TestCase):
    def check(self, source, urdf, joints):
        random = np.random.default_rng(3)
        for convention in ("standard", "modified"):
            table = scratch() / f"{convention}.csv"
            told = kinescope.export(source, dh=table, dh_convention=convention, force=True)["dh"]
            self.assertEqual(told["convention"], convention)
            for _ in range(10):
                q = dict(zip(joints, random.uniform(-2, 2, len(joints)), strict=True))
                links = forward_of_urdf(urdf, q)
                chains = forward_of_table(table, convention, q)
                self.assertEqual(list(chains), [chain["tip"] for chain in told["chains"]])
                for tip, T in chains.items():
                    np.testing.assert_allclose(T, links[tip], atol=SAME)

    def test_a_run_s_table_alone_gives_its_forward_kinematics(self):
        _, folder = run_of_sample()
        joints = list(read_csv(folder / "joint_values.csv")[0])[1:]
        self.check(folder, folder / "robot.urdf", joints)

    def test_so_does_a_urdf_s(self):
        for name in ("ur6_none", "gantry_time_lag"):
            urdf = SCARA.parent / name / "truth.urdf"
            self.check(urdf, urdf, moving_joints(urdf))


# ---- MCAP, by https://mcap.dev/spec ----

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F


def unzstd(packed, size):
    """By the C library: Python has none before 3.14."""
    zstd = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
    zstd.ZSTD_decompress.restype = ctypes.c_size_t
    out = ctypes.create_string_buffer(size)
    got = zstd.ZSTD_decompress(
        out, ctypes.c_size_t(size), packed, ctypes.c_size_t(len(packed))
    )
    return out.raw[:got] if got == size else b""


class Cursor:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, size):
        if self.at + size > len(self.data):
            raise ValueError("the record ends early")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self, kind):
        return struct.unpack("<" + kind, self.take(struct.calcsize("<" + kind)))[0]

    def text(self):
        return self.take(self.number("I")).decode()

    def pairs(self, key, value):
        end = self.number("I") + self.at
        out = []
        while self.at < end:
            out.append((self.number(key), self.number(value)))
        assert self.at == end
        return out

    def done(self):
        return self.at == len(self.data)


def records(data, start=0):
    """(opcode, content, offset, bytes with the head) one after the other."""
    cursor = Cursor(data)
    while not cursor.done():
        at = cursor.at
        opcode = cursor.number("B")
        content = cursor.take(cursor.number("Q"))
        yield opcode, content, start + at, cursor.at - at


class Mcap(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        _, folder = run_of_sample()
        cls.told = kinescope.export(folder, mcap=scratch() / "run.mcap")["mcap"]
        cls.bytes = (scratch() / "run.mcap").read_bytes()
        cls.records = list(records(cls.bytes[8:-8], 8))

    def of(self, opcode):
        return [record for record in self.records if record[0] == opcode]

    def test_order_of_records(self):
        self.assertTrue(self.bytes.startswith(MAGIC) and self.bytes.endswith(MAGIC))
        order = [record[0] for record in self.records]
        self.assertEqual((order[0], order[-1]), (HEADER, FOOTER))
        end = order.index(DATA_END)
        self.assertLessEqual(set(order[1:end]), {CHUNK, MESSAGE_INDEX})
        groups = [SCHEMA, CHANNEL, STATISTICS, CHUNK_INDEX, SUMMARY_OFFSET]
        self.assertEqual(sorted(order[end + 1 : -1], key=groups.index), order[end + 1 : -1])
        self.assertGreater(len(self.of(CHUNK)), 1)

    def test_checksums(self):
        (_, content, start, _), = self.of(DATA_END)
        self.assertEqual(Cursor(content).number("I"), zlib.crc32(self.bytes[:start]))
        (_, content, footer, _), = self.of(FOOTER)
        cursor = Cursor(content)
        summary, offsets, crc = cursor.number("Q"), cursor.number("Q"), cursor.number("I")
        self.assertTrue(cursor.done())
        self.assertEqual(summary, self.of(SCHEMA)[0][2])
        self.assertEqual(offsets, self.of(SUMMARY_OFFSET)[0][2])
        self.assertEqual(crc, zlib.crc32(self.bytes[summary : footer + 9 + 16]))

    def chunks(self):
        """(first, last, records, offset, length) of each."""
        for _, content, at, size in self.of(CHUNK):
            cursor = Cursor(content)
            first, last, whole, crc = (cursor.number(k) for k in "QQQI")
            self.assertEqual(cursor.text(), "zstd")
            data = unzstd(cursor.take(cursor.number("Q")), whole)
            self.assertTrue(cursor.done())
            self.assertEqual(zlib.crc32(data), crc)
            yield first, last, data, at, size

    def test_indexes_lead_to_the_messages(self):
        indexes = self.of(CHUNK_INDEX)
        for (first, last, data, at, size), (_, content, _, _) in zip(
            self.chunks(), indexes, strict=True
        ):
            cursor = Cursor(content)
            self.assertEqual([cursor.number("Q") for _ in range(4)], [first, last, at, size])
            offsets, length = dict(cursor.pairs("H", "Q")), cursor.number("Q")
            self.assertEqual(cursor.text(), "zstd")
            self.assertLess(cursor.number("Q"), size)
            self.assertEqual(cursor.number("Q"), len(data))
            seen = []
            behind = list(records(self.bytes[at + size : at + size + length], at + size))
            self.assertEqual([record[0] for record in behind], [MESSAGE_INDEX] * len(offsets))
            for _, index, where, _ in behind:
                cursor = Cursor(index)
                channel = cursor.number("H")
                self.assertEqual(offsets[channel], where)
                for time, place in cursor.pairs("Q", "Q"):
                    opcode, message, _, _ = next(records(data[place:]))
                    self.assertEqual(opcode, MESSAGE)
                    self.assertEqual(struct.unpack_from("<HIQQ", message)[::2], (channel, time))
                    self.assertTrue(first <= time <= last)
                    seen.append(place)
            messages = [r for r in records(data) if r[0] == MESSAGE]
            self.assertEqual(sorted(seen), [r[2] for r in messages])

    def messages(self):
        """Of every topic: its schema's name, and the messages with their times."""
        schemas, channels, out = {}, {}, {}
        for _, _, data, _, _ in self.chunks():
            for opcode, content, _, _ in records(data):
                cursor = Cursor(content)
                if opcode == SCHEMA:
                    number, name, encoding = cursor.number("H"), cursor.text(), cursor.text()
                    self.assertEqual(encoding, "jsonschema")
                    schemas[number] = name, json.loads(cursor.text())
                elif opcode == CHANNEL:
                    number, schema = cursor.number("H"), cursor.number("H")
                    channels[number] = cursor.text(), schemas[schema]
                    self.assertEqual(cursor.text(), "json")
                elif opcode == MESSAGE:
                    channel, _, time, _ = (cursor.number(k) for k in "HIQQ")
                    topic, schema = channels[channel]
                    out.setdefault(topic, (schema, []))[1].append(
                        (time, json.loads(content[cursor.at :]))
                    )
        return out

    def test_statistics(self):
        (_, content, _, _), = self.of(STATISTICS)
        cursor = Cursor(content)
        total, schemas, channels = (cursor.number(k) for k in "QHI")
        attachments, metadata, chunks = (cursor.number("I") for _ in range(3))
        first, last = cursor.number("Q"), cursor.number("Q")
        messages = self.messages()
        times = [time for _, found in messages.values() for time, _ in found]
        self.assertEqual((total, first, last), (len(times), min(times), max(times)))
        self.assertEqual((schemas, channels), (len(messages), len(messages)))
        self.assertEqual((attachments, metadata, chunks), (0, 0, len(self.of(CHUNK))))
        self.assertEqual(sum(n for _, n in cursor.pairs("H", "Q")), total)
        self.assertTrue(cursor.done())

    def test_summary_offsets(self):
        for _, content, _, _ in self.of(SUMMARY_OFFSET):
            cursor = Cursor(content)
            opcode, start, length = (cursor.number(k) for k in "BQQ")
            group = list(records(self.bytes[start : start + length]))
            self.assertEqual([record[0] for record in group], [opcode] * len(self.of(opcode)))

    def test_messages_are_what_their_schemas_say(self):
        for topic, ((name, schema), found) in self.messages().items():
            self.assertEqual(self.told["topics"][topic], {"schema": name, "messages": len(found)})
            self.assertEqual(schema["title"], name)
            for _, message in found[:3]:
                self.check(message, schema, topic)

    def check(self, value, schema, place):
        kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int}
        self.assertIsInstance(value, kinds.get(schema["type"], (int, float)), place)
        for key, one in (value.items() if isinstance(value, dict) else ()):
            known = schema.get("properties", {}).get(key) or schema.get("additionalProperties")
            self.assertIsNotNone(known, f"{place}.{key}")
            self.check(one, known, f"{place}.{key}")
        if isinstance(value, dict) and "additionalProperties" not in schema:
            self.assertEqual(set(value), set(schema.get("properties", {})), place)
        for one in value if isinstance(value, list) else ():
            self.check(one, schema["items"], place)

    def test_frames_are_the_robot_s(self):
        _, folder = run_of_sample()
        values = read_csv(folder / "joint_values.csv")
        _, found = self.messages()["/tf"]
        self.assertEqual(len(found), len(values))
        joints = dict(values[11])
        time = float(joints.pop("t"))
        self.assertAlmostEqual(found[11][0] * 1e-9, time, 6)
        links = forward_of_urdf(folder / "robot.urdf", {k: float(v) for k, v in joints.items()})
        for one in found[11][1]["transforms"]:
            numbers = [one["translation"][k] for k in "xyz"] + [one["rotation"][k] for k in "xyzw"]
            T = pose_of(*numbers)
            expected = np.linalg.inv(links[one["parent_frame_id"]]) @ links[one["child_frame_id"]]
            np.testing.assert_allclose(T, expected, atol=SAME)

    def test_residuals_are_those_of_residuals_csv(self):
        _, folder = run_of_sample()
        _, found = self.messages()["/residuals"]
        squares = {}
        for row in read_csv(folder / "residuals.csv"):
            if row["used"] == "1":
                squares.setdefault(float(row["t"]), []).append(
                    float(row["du"]) ** 2 + float(row["dv"]) ** 2
                )
        for (t, expected), (time, message) in zip(sorted(squares.items()), found, strict=True):
            self.assertAlmostEqual(time * 1e-9, t, 6)
            self.assertAlmostEqual(message["frame"]["rms_px"], np.mean(expected) ** 0.5, 12)


if __name__ == "__main__":
    unittest.main()
