# SPDX-License-Identifier: Apache-2.0
"""Torque models on arrays against `kinescope predict`."""

import csv
import functools
import gc
import unittest
import warnings

import numpy as np

import kinescope
from program import SCARA, run_program, scratch

PRINTED = 1e-8  # relative: nine digits of the table
EFFECTS = """effects:
  - {effect: stribeck, joint: %s, at: 0.05, parameters: {excess_at_rest: 1.5}}
  - {effect: viscous, joint: %s, parameters: {viscous: 0.8}}
"""


@functools.cache
def logs():
    """Two logs of a simulated robot with friction, with noise."""
    out = []
    for i in range(2):
        log = scratch() / f"log{i}.csv"
        trajectory = write_trajectory(i)
        effects = scratch() / "effects.yaml"
        effects.write_text(EFFECTS % ("joint2", "joint2"))
        kinescope.simulate(
            SCARA / "truth.urdf",
            trajectory=trajectory,
            effects=effects,
            torque_noise=0.02,
            rate=200,
            seed=i + 1,
            output=log,
        )
        out.append(log)
    return out


def write_trajectory(seed):
    names = ["joint1", "joint2", "joint3", "joint4"]
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 12.0, 0.01)
    path = scratch() / f"trajectory{seed}.csv"
    q = [
        sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(*rng.uniform(0.1, 0.7, (3, 3))))
        for _ in names
    ]
    q[2] = 0.1 * q[2]  # slides
    with open(path, "w", encoding="utf-8") as file:
        file.write("t," + ",".join(names) + "\n")
        for row in np.column_stack([t, *q]):
            file.write(",".join(f"{value:.9g}" for value in row) + "\n")
    return path


@functools.cache
def model_file(name):
    path = scratch() / f"{name}.json"
    kinescope.dynamics(
        logs()[0],
        robot=SCARA / "truth.urdf",
        model=[name],
        save_model=path,
        no_trace=name != "parametric",
        samples=200,
        output=scratch() / f"{name}_dynamics",
    )
    return path


def table_of_program(model, log):
    path = scratch() / f"{model.stem}_predicted.csv"
    run_program("predict", log, "--model", model, "--output", path, "--force")
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


class Models(unittest.TestCase):
    def setUp(self):
        # The logs' noise has outliers, and a joint that hardly needs a torque.
        context = warnings.catch_warnings()
        context.__enter__()
        self.addCleanup(context.__exit__, None, None, None)
        warnings.simplefilter("ignore", kinescope.InputWarning)

    def test_what_is_odd_about_a_log_is_a_warning(self):
        model = kinescope.TorqueModel(model_file("gip"))
        log = scratch() / "odd.csv"
        rows = logs()[1].read_text().splitlines()
        rows[500] = ",".join([*rows[500].split(",")[:-1], "1000"])  # N m, for one sample
        log.write_text("\n".join(rows))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            model.read_log(log)
        self.assertEqual({one.filename for one in caught}, {__file__})
        self.assertIn(kinescope.InputWarning, {one.category for one in caught})
        self.assertTrue(any("odd.csv" in str(one.message) for one in caught))

    def test_torques_are_those_of_predict(self):
        for name in ("gip", "semi_parametric"):
            model = kinescope.TorqueModel(model_file(name))
            self.assertEqual((model.kind, model.unit, model.traced), (name, "Nm", False))
            log = model.read_log(logs()[1])
            table = table_of_program(model_file(name), logs()[1])
            torque, sigma = model.predict(log.q, log.qd, log.qdd)
            np.testing.assert_array_equal(log.t, table["t"])
            for j, joint in enumerate(model.joints):
                np.testing.assert_allclose(torque[:, j], table[f"mean_{joint}"], rtol=PRINTED)
                np.testing.assert_allclose(
                    model.band90[j] * sigma[:, j], table[f"band90_{joint}"], rtol=PRINTED
                )
                np.testing.assert_allclose(log.torque[:, j], table[f"torque_{joint}"], rtol=PRINTED)

    def test_traced_torques_are_those_of_predict(self):
        model = kinescope.TorqueModel(model_file("parametric"))
        self.assertTrue(model.traced)
        log = model.read_log([logs()[1]])
        torque, _ = model.predict(
            log.q, log.qd, log.qdd, t=log.t, trajectory=log.trajectory, traced=True
        )
        table = table_of_program(model_file("parametric"), logs()[1])
        for j, joint in enumerate(model.joints):
            np.testing.assert_allclose(
                torque[:, j], table[f"mean_{joint}"], rtol=PRINTED, atol=1e-9
            )
        plain = model.predict(log.q, log.qd, log.qdd).torque
        self.assertGreater(np.abs(plain - torque).max(), 1e-3)

    def test_predict_of_the_module_writes_the_bytes_of_the_program(self):
        one, other = scratch() / "one.csv", scratch() / "other.csv"
        model = model_file("parametric")
        kinescope.predict(logs()[1], model=model, output=one)
        run_program("predict", logs()[1], "--model", model, "--output", other)
        self.assertEqual(one.read_bytes(), other.read_bytes())

    def test_rows_alone_and_threads_give_the_same(self):
        model = kinescope.TorqueModel(model_file("semi_parametric"))
        log = model.read_log(logs()[1])
        all_rows = model.predict(log.q, log.qd, log.qdd, threads=2)
        np.testing.assert_array_equal(
            all_rows.torque, model.predict(log.q, log.qd, log.qdd, threads=1).torque
        )
        one = model.predict(log.q[5], log.qd[5], log.qdd[5])
        self.assertEqual(one.torque.shape, (1, 4))
        np.testing.assert_array_equal(one.torque[0], all_rows.torque[5])
        strided = model.predict(log.q[::3], np.asfortranarray(log.qd)[::3], log.qdd[::3])
        np.testing.assert_array_equal(strided.torque, all_rows.torque[::3])

    def test_arrays_outlive_the_model(self):
        model = kinescope.TorqueModel(model_file("gip"))
        log = model.read_log(logs()[1])
        torque = model.predict(log.q, log.qd, log.qdd).torque
        kept = torque.copy()
        del model
        gc.collect()
        np.testing.assert_array_equal(torque, kept)

    def test_motions_that_are_none_are_refused(self):
        model = kinescope.TorqueModel(model_file("parametric"))
        z = np.zeros((3, 4))
        bad = z.copy()
        bad[2, 3] = np.nan
        for q, qd, qdd, more, words in (
            (z, z, bad, {}, r"qdd\[2, 3\]: is nan"),
            (z, z[:, :3], z, {}, r"qd: has shape \(3, 3\)"),
            (z, z, z[:2], {}, "3, 3 and 2 rows"),
            (z, z, z, {"traced": True}, "t: is missing"),
            (z, z, z, {"t": [0, 1, 2]}, "single samples need none"),
            (z, z, z, {"t": [0, 1], "traced": True}, "2 and 2 entries for 3"),
            (z, z, z, {"t": [0, 2, 1], "traced": True}, r"t\[2\]: does not increase"),
            (z, z, z, {"t": [0, 1, 2], "trajectory": [0, 0.5, 1], "traced": True}, "whole"),
        ):
            with self.assertRaisesRegex(kinescope.BadRequest, words):
                model.predict(q, qd, qdd, **more)
        with self.assertRaisesRegex(kinescope.BadRequest, "no effects"):
            kinescope.TorqueModel(model_file("gip")).predict(z, z, z, t=[0, 1, 2], traced=True)

    def test_files_that_are_no_model_are_refused(self):
        text = model_file("gip").read_text()
        bad = scratch() / "bad.json"
        for content in ("", "{}", text[: len(text) // 2]):
            bad.write_text(content)
            with self.assertRaises(kinescope.BadInput):
                kinescope.TorqueModel(bad)
        with self.assertRaises(kinescope.BadInput):
            kinescope.TorqueModel("/nowhere.json")
        model = kinescope.TorqueModel(model_file("gip"))
        with self.assertRaises(kinescope.BadInput):
            model.read_log("/nowhere.csv")
        with self.assertRaises(kinescope.BadRequest):
            model.read_log([])


if __name__ == "__main__":
    unittest.main()
