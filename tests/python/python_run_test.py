# SPDX-License-Identifier: Apache-2.0
"""A run's arrays against its files, and against the same written with NumPy alone."""

import csv
import gc
import json
import shutil
import unittest
import xml.etree.ElementTree as xml
from dataclasses import replace

import numpy as np

import kinescope
from program import SCARA, run_of_sample, scratch

SAME = 1e-4  # m: video and corners go through other hypotheses, below the sigma of a marker


def read_csv(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def rotation_of_rpy(roll, pitch, yaw):
    """Fixed axes x, y, z, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def motion(kind, axis, value):
    """exp(axis * value), Rodrigues."""
    T, (x, y, z) = np.eye(4), axis
    if kind == "prismatic":
        T[:3, 3] = value * axis
    else:
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        T[:3, :3] += np.sin(value) * K + (1 - np.cos(value)) * K @ K
    return T


def forward_of_urdf(path, values):
    """T_root_link of every link, from the URDF's text alone."""
    root = xml.parse(path).getroot()
    joints = {joint.find("child").get("link"): joint for joint in root.findall("joint")}

    def pose(link):
        if link not in joints:
            return np.eye(4)
        joint = joints[link]
        origin = joint.find("origin")
        T = np.eye(4)
        if origin is not None:
            T[:3, :3] = rotation_of_rpy(*map(float, origin.get("rpy", "0 0 0").split()))
            T[:3, 3] = [float(v) for v in origin.get("xyz", "0 0 0").split()]
        out = pose(joint.find("parent").get("link")) @ T
        if joint.get("type") == "fixed":
            return out
        axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
        kind = "prismatic" if joint.get("type") == "prismatic" else "revolute"
        return out @ motion(kind, axis, values[joint.get("name")])

    return {link.get("name"): pose(link.get("name")) for link in root.findall("link")}


class RunArrays(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.result, cls.folder = run_of_sample()
        cls.run_ = kinescope.Run(cls.folder)
        low, high = cls.run_.range.T
        cls.q = np.random.default_rng(1).uniform(low, high, (50, len(low)))

    def test_tree_is_that_of_calibration_json(self):
        run, robot = self.run_, json.loads((self.folder / "calibration.json").read_text())["robot"]
        self.assertEqual(run.name, robot["name"])
        self.assertEqual(list(run.links), robot["links"])
        self.assertEqual(len(run.moving), 4)
        for joint, stored in zip(run.joints, robot["joints"], strict=True):
            for name in ("name", "type", "parent", "child", "channel", "scale", "offset"):
                self.assertEqual(getattr(joint, name), stored[name])
            np.testing.assert_array_equal(joint.axis, stored["axis"])
            np.testing.assert_array_equal(joint.range, stored["range"])
            np.testing.assert_array_equal(
                joint.T_parent_joint[:3, 3], stored["T_parent_joint"]["translation_m"]
            )
        self.assertEqual([m.id for m in run.markers], [m["id"] for m in robot["markers"]])

    def test_parameters_are_those_of_calibration_json(self):
        stored = json.loads((self.folder / "calibration.json").read_text())
        parameters = self.run_.parameters
        n = len(stored["parameters"])
        self.assertGreater(n, 20)
        self.assertEqual(list(parameters.names), [row["name"] for row in stored["parameters"]])
        for i, row in enumerate(stored["parameters"]):
            self.assertEqual(parameters.values[i], row["value"])
            expected = np.nan if row["sigma"] is None else row["sigma"]
            np.testing.assert_equal(parameters.sigma[i], expected)
        np.testing.assert_array_equal(parameters.covariance, stored["covariance"])
        self.assertEqual(parameters.covariance.shape, (n, n))
        known = np.isfinite(parameters.sigma)
        self.assertTrue(np.any(known))
        np.testing.assert_allclose(
            np.sqrt(np.diag(parameters.covariance))[known], parameters.sigma[known], rtol=1e-6
        )

    def test_forward_is_that_of_the_urdf(self):
        poses = self.run_.forward(self.q)
        for i in (0, 7, 49):
            values = {joint.name: self.q[i, j] for j, joint in enumerate(self.run_.moving)}
            for link, T in forward_of_urdf(self.folder / "robot.urdf", values).items():
                if link in poses:
                    np.testing.assert_allclose(poses[link][i], T, atol=1e-9, err_msg=link)
        self.assertEqual(set(poses), set(self.run_.links))
        self.assertEqual(poses[self.run_.links[-1]].shape, (50, 4, 4))

    def test_screws_give_the_same_poses(self):
        def exponential(twist):
            (wx, wy, wz), v = twist[:3], twist[3:]
            A = np.zeros((4, 4))
            A[:3, :3] = [[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]]
            A[:3, 3] = v
            term = out = np.eye(4)
            for k in range(1, 40):
                term = term @ A / k
                out = out + term
            return out

        # The sample is one chain, in the order of its joints.
        last = self.run_.moving[-1].child
        T = self.run_.forward(np.zeros(4))[last][0]
        for screw, value in reversed(list(zip(self.run_.screws, self.q[3]))):
            T = exponential(screw * value) @ T
        np.testing.assert_allclose(self.run_.forward(self.q[3])[last][0], T, atol=1e-10)

    def test_jacobian_is_the_derivative(self):
        link, step = self.run_.links[-1], 1e-6
        J = self.run_.jacobian(self.q, link)
        self.assertEqual(J.shape, (50, 6, 4))
        T = self.run_.forward(self.q)[link]
        for j in range(4):
            moved = self.run_.forward(self.q + step * np.eye(4)[j])[link]
            twist = np.linalg.inv(T) @ moved / step
            np.testing.assert_allclose(J[:, 3:, j], twist[:, :3, 3], atol=1e-5)
            np.testing.assert_allclose(
                J[:, :3, j],
                np.stack([twist[:, 2, 1], twist[:, 0, 2], twist[:, 1, 0]], 1),
                atol=1e-5,
            )

    def test_predicted_corners_and_residuals_are_the_observations(self):
        run = self.run_
        log = read_csv(SCARA / "joints.csv")
        channels = {joint.channel for joint in run.moving}
        t = np.array([float(row["t"]) for row in log])
        seen = {
            (row["t"], row["tag"], row["corner"]): (float(row["u"]), float(row["v"]))
            for row in read_csv(self.folder / "observations.csv")
        }
        markers = {marker.id: marker for marker in run.markers}
        rows = run.residuals
        keys = [
            (row["t"], row["tag"], row["corner"])
            for row in read_csv(self.folder / "residuals.csv")
        ]
        frames, of_frame = np.unique(rows.t, return_inverse=True)
        readings = {
            name: np.interp(frames + run.time_offset, t, [float(row[name]) for row in log])
            for name in channels
        }
        q = run.joint_values(readings)
        predicted = {
            number: run.project(run.marker_corners(q, marker).reshape(-1, 3)).reshape(-1, 4, 2)
            for number, marker in markers.items()
        }
        worst = 0.0
        for i, key in enumerate(keys):
            at = predicted[rows.marker[i]][of_frame[i], rows.corner[i]]
            worst = max(worst, np.abs(at + rows.final[i] - seen[key]).max())
        self.assertGreater(len(keys), 1000)
        # Between readings the program's interpolation is smoother than a straight line.
        self.assertLess(worst, 0.05)

    def test_residuals_have_the_rms_of_the_run(self):
        rows = self.run_.residuals
        distance = np.linalg.norm(rows.final[rows.used], axis=1)
        self.assertAlmostEqual(
            float(np.sqrt(np.mean(distance**2))), self.run_.errors["final"], delta=1e-4
        )
        self.assertEqual(rows.final.shape, (len(rows.t), 2))
        self.assertEqual(rows.held_out.shape, rows.final.shape)
        self.assertEqual(self.run_.errors["unit"], "px")

    def test_tracks_are_those_of_tracks_csv(self):
        tracks = self.run_.tracks
        row = read_csv(self.folder / "tracks.csv")[100]
        self.assertEqual((tracks.t[100], tracks.marker[100]), (float(row["t"]), int(row["body"])))
        np.testing.assert_array_equal(
            tracks.T_camera_marker[100, :3, 3], [float(row[name]) for name in "xyz"]
        )
        R = tracks.T_camera_marker[:, :3, :3]
        unit = np.broadcast_to(np.eye(3), R.shape)
        np.testing.assert_allclose(R @ R.transpose(0, 2, 1), unit, atol=1e-9)
        np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-9)

    def test_documents(self):
        self.assertEqual(self.run_.result, self.result)
        self.assertEqual(self.run_.structure["schema"], "kinescope.structure")
        self.assertEqual(self.run_.effects, [])

    def test_any_layout_and_type_is_taken(self):
        q = np.round(self.q, 1)
        expected = self.run_.forward(q)[self.run_.links[-1]]
        wide = np.zeros((100, 8))
        wide[::2, ::2] = q
        for same in (np.asfortranarray(q), wide[::2, ::2], q.tolist(), q.astype(">f8"), q[::-1][::-1]):
            np.testing.assert_array_equal(self.run_.forward(same)[self.run_.links[-1]], expected)
        whole = self.run_.forward(np.zeros((2, 4), dtype=np.int8))
        np.testing.assert_array_equal(whole["base"], [np.eye(4)] * 2)
        self.assertEqual(self.run_.forward(np.zeros((0, 4)))["base"].shape, (0, 4, 4))
        locked = q.copy()
        locked.flags.writeable = False
        self.run_.forward(locked)

    def test_what_is_no_row_of_joint_values_is_refused(self):
        bad = self.q.copy()
        bad[3, 1] = np.nan
        for value, words in (
            (bad, r"q\[3, 1\]: is nan"),
            (np.full(4, np.inf), r"q\[0\]: is inf"),
            (np.zeros((2, 3)), r"q: has shape \(2, 3\)"),
            (np.zeros((1, 2, 4)), r"shape \(1, 2, 4\)"),
            (3.0, r"shape \(\)"),
            (np.zeros((2, 4), dtype=complex), "complex128"),
            (["a", "b", "c", "d"], "no real numbers"),
            ([[1, 2, 3, 4], [1]], "no array of numbers|no real numbers"),
            (None, "no real numbers"),
        ):
            with self.assertRaisesRegex(kinescope.BadRequest, words):
                self.run_.forward(value)
        with self.assertRaisesRegex(kinescope.BadRequest, "no link is named nowhere"):
            self.run_.jacobian(self.q, "nowhere")
        for value in (np.zeros((2, 2)), np.zeros((2, 3), complex), [[np.nan] * 3], "abc"):
            with self.assertRaises(kinescope.BadRequest):
                self.run_.project(value)

    def test_points_behind_the_camera_have_no_pixel(self):
        T = self.run_.T_camera_base
        behind = -T[:3, :3].T @ T[:3, 3] + T[:3, :3].T @ [0, 0, -1.0]
        before = -T[:3, :3].T @ T[:3, 3] + T[:3, :3].T @ [0, 0, 1.0]
        pixels = self.run_.project([behind, before])
        self.assertTrue(np.isnan(pixels[0]).all())
        np.testing.assert_allclose(pixels[1], self.run_.camera.K[:2, 2], atol=1e-6)

    def test_joint_values_want_every_channel(self):
        channel = self.run_.moving[0].channel
        with self.assertRaisesRegex(kinescope.BadRequest, "which drives"):
            self.run_.joint_values({channel: [0.0]})
        readings = {joint.channel: np.zeros(3) for joint in self.run_.moving}
        self.assertEqual(self.run_.joint_values(readings).shape, (3, 4))
        readings[channel] = np.zeros((3, 1))
        with self.assertRaisesRegex(kinescope.BadRequest, r"shape \(3, 1\)"):
            self.run_.joint_values(readings)

    def test_arrays_outlive_the_run(self):
        run = kinescope.Run(self.folder)
        poses, rows, screws = run.forward(self.q), run.residuals, run.screws
        kept = [poses[run.links[-1]].copy(), rows.final.copy(), screws.copy()]
        link = run.links[-1]
        del run
        gc.collect()
        np.ones((1000, 1000))  # what was freed is written over
        for array, before in zip([poses[link], rows.final, screws], kept):
            np.testing.assert_array_equal(array, before)

    def test_arrays_are_copies(self):
        link = self.run_.links[-1]
        self.run_.forward(self.q)[link][:] = 0.0
        self.assertNotEqual(self.run_.forward(self.q)[link][0, 0, 0], 0.0)


def arrays_of_sample():
    """What a detector of one's own would give: arguments of `kinescope.calibrate`."""
    _, folder = run_of_sample()
    seen = read_csv(folder / "observations.csv")
    log = read_csv(SCARA / "joints.csv")
    channels = [name for name in log[0] if name != "t"]
    first = [row for row in seen if row["corner"] == "0"]
    marker_size = {marker.id: marker.size for marker in kinescope.Run(folder).markers}
    return {
        "corners": np.reshape([(float(row["u"]), float(row["v"])) for row in seen], (-1, 4, 2)),
        "markers": [int(row["tag"]) for row in first],
        "frame_times": [float(row["t"]) for row in first],
        "joint_values": np.array([[float(row[name]) for name in channels] for row in log]),
        "joint_times": [float(row["t"]) for row in log],
        "channels": channels,
        "marker_size": marker_size,
        "image_size": (kinescope.Run(folder).camera.width, kinescope.Run(folder).camera.height),
        "camera": kinescope.Run(folder).camera,
        "folds": 2,
    }


class ArraysInMemory(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.given = arrays_of_sample()
        cls.run_ = kinescope.Run(run_of_sample()[1])
        cls.found = kinescope.calibrate(**cls.given)

    def test_the_robot_is_that_of_the_run(self):
        self.assertEqual(self.found.status, "converged")
        of_run = {joint.channel: joint for joint in self.run_.moving}
        self.assertEqual([j.channel for j in self.found.moving], [j.channel for j in self.run_.moving])
        for joint in self.found.moving:
            self.assertEqual(joint.type, of_run[joint.channel].type)
        q = self.run_.range.T
        camera = self.found.T_camera_base, self.run_.T_camera_base
        for mine, its in zip(self.found.markers, self.run_.markers, strict=True):
            self.assertEqual(mine.id, its.id)
            corners = self.found.marker_corners(q, mine), self.run_.marker_corners(q, its)
            places = [c @ T[:3, :3].T + T[:3, 3] for c, T in zip(corners, camera)]
            np.testing.assert_allclose(*places, atol=SAME)
        self.assertAlmostEqual(self.found.errors["final"], self.run_.errors["final"], delta=0.002)
        self.assertEqual(self.found.residuals.final.shape[1], 2)

    def test_order_of_sightings_and_layout_say_nothing(self):
        order = np.random.default_rng(2).permutation(len(self.given["markers"]))
        mixed = dict(self.given, corners=np.asfortranarray(self.given["corners"][order]))
        for name in ("markers", "frame_times"):
            mixed[name] = np.array(self.given[name])[order]
        self.assertEqual(kinescope.calibrate(**mixed).document, self.found.document)

    def test_what_does_not_fit_is_refused(self):
        given = self.given
        n = len(given["markers"])
        bad = given["corners"].copy()
        bad[2, 1, 0] = np.nan
        camera = given["camera"]
        for change, words in (
            ({"corners": given["corners"][:, :3]}, "corners: has shape"),
            ({"corners": bad}, r"corners\[2, 2\]: is nan"),
            ({"markers": given["markers"][1:]}, f"{n - 1} entries for {n} sightings"),
            ({"markers": np.full(n, 0.5)}, "whole numbers"),
            ({"frame_times": np.zeros(n)}, "second time"),
            ({"joint_times": given["joint_times"][::-1]}, r"joint_times\[1\]: does not increase"),
            ({"joint_values": given["joint_values"][:, :3]}, "joint_values: has shape"),
            ({"joint_values": given["joint_values"][:9]}, "9 entries"),
            ({"channels": ["a", "a", "b", "c"]}, "one name"),
            ({"marker_size": -1.0}, "no length"),
            ({"sigma_px": 0.0}, "standard deviation"),
            ({"folds": 51}, "0 to 50"),
            ({"units": {"ch0": "feet"}}, "'feet' of ch0"),
            ({"camera": replace(camera, K=np.zeros((3, 3)))}, "no camera matrix"),
            ({"camera": replace(camera, model="fish")}, "no distortion model"),
            ({"camera": replace(camera, distortion=np.zeros(3))}, "3 entries for"),
        ):
            with self.assertRaisesRegex(kinescope.BadRequest, words):
                kinescope.calibrate(**{**given, **change})
        with self.assertRaisesRegex(kinescope.BadInput, "no size"):
            kinescope.calibrate(**{**given, "marker_size": {1: 0.05}})
        with self.assertRaises(kinescope.BadInput):
            kinescope.calibrate(**{**given, "joint_times": np.add(given["joint_times"], 1e4)})
        with self.assertRaises(kinescope.Undetermined):
            kinescope.calibrate(**{**given, "joint_values": np.zeros_like(given["joint_values"])})


class BadFolders(unittest.TestCase):
    def test_are_refused_in_one_line(self):
        _, folder = run_of_sample()
        with self.assertRaisesRegex(kinescope.BadInput, "calibration.json"):
            kinescope.Run("/nowhere")
        text = (folder / "calibration.json").read_text()
        bad = scratch() / "bad"
        bad.mkdir()
        for content in ("", "{", text[: len(text) // 2], "[]", text.replace("T_camera_base", "x")):
            (bad / "calibration.json").write_text(content)
            with self.assertRaises(kinescope.BadInput) as caught:
                kinescope.Run(bad)
            self.assertNotIn("\n", str(caught.exception))
        (bad / "calibration.json").write_text(text)
        run = kinescope.Run(bad)
        with self.assertRaisesRegex(kinescope.BadInput, "residuals.csv"):
            _ = run.residuals
        shutil.copy(folder / "residuals.csv", bad)
        with open(bad / "residuals.csv", "a", encoding="utf-8") as file:
            file.write("1,2,3\n")
        with self.assertRaisesRegex(kinescope.BadInput, "residuals.csv"):
            _ = run.residuals


if __name__ == "__main__":
    unittest.main()
