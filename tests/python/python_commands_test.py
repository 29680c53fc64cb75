# SPDX-License-Identifier: Apache-2.0
"""Commands as functions: what the program gives, errors, warnings, threads, Ctrl-C."""

import inspect
import io
import json
import os
import pydoc
import shutil
import signal
import subprocess
import sys
import threading
import time
import unittest
import warnings
from contextlib import redirect_stderr, redirect_stdout

import numpy as np

import kinescope
from program import PROGRAM, SCARA, run_of_sample, run_program, scratch


class Commands(unittest.TestCase):
    def test_every_command_of_the_help_is_a_function(self):
        listed = run_program("--help").stdout.decode().split("Subcommands:\n")[1].split("\n\n")[0]
        commands = [line.split()[0] for line in listed.splitlines() if line[2:3] != " "]
        self.assertGreater(len(commands), 10)
        for command in commands:
            function = getattr(kinescope, command)
            names = set(inspect.signature(function).parameters) - {"progress"}
            text = run_program(command, "--help").stdout.decode()
            in_help = {
                word.split("{")[0][2:].replace("-", "_")
                for line in text.splitlines()
                if line.startswith("  -")
                for word in line.split()[0].split(",")
                if word.startswith("--")
            } - {"help", "json", "quiet"}
            self.assertLessEqual(in_help, names, command)
            positionals = names - in_help
            for name in positionals:
                self.assertIn(f"  {name.upper()} ", text, command)

    def test_help_says_what_the_program_says(self):
        text = pydoc.render_doc(kinescope.run, renderer=pydoc.plaintext)
        self.assertIn("no_time_offset: bool", text)
        self.assertIn("Trust the clocks of camera and log to agree", text)
        self.assertIn("folds: N, 0 to 50, default 5", text)

    def test_run_writes_the_bytes_of_the_program(self):
        result, folder = run_of_sample()
        other = scratch() / "run_of_program"
        done = run_program(
            "run", SCARA, "--output", other, "--no-trace", "--folds", "2", "--json", "--quiet"
        )
        self.assertEqual(set(os.listdir(folder)), set(os.listdir(other)))
        for name in sorted(os.listdir(folder)):
            if name in ("report.html", "run.json", "observations.json"):
                continue  # stage times, and the command line
            self.assertEqual((folder / name).read_bytes(), (other / name).read_bytes(), name)
        self.assertEqual(result, json.loads(done.stdout))

    def test_run_json_has_the_words_that_run_it_again(self):
        _, folder = run_of_sample()
        words = json.loads((folder / "run.json").read_text())["arguments"]
        self.assertEqual(words[:2], ["run", str(SCARA)])
        self.assertIn("--no-trace", words)
        self.assertNotIn("--json", words)

    def test_inspect_and_export_give_what_json_prints(self):
        done = run_program("inspect", SCARA, "--json", "--quiet")
        self.assertEqual(kinescope.inspect(SCARA), json.loads(done.stdout))
        one, other = scratch() / "one.xml", scratch() / "other.xml"
        kinescope.export(SCARA / "truth.urdf", mjcf=one)
        run_program("export", SCARA / "truth.urdf", "--mjcf", other)
        self.assertEqual(one.read_bytes(), other.read_bytes())

    def test_values_are_written_as_on_a_command_line(self):
        pdf = scratch() / "markers.pdf"
        result = kinescope.markers(ids="0-3", size=np.float64(0.05), output=str(pdf))
        self.assertEqual((result["ids"], result["size_m"]), ([0, 1, 2, 3], 0.05))
        other = scratch() / "markers_of_program.pdf"
        run_program("markers", "--ids", "0-3", "--size", "0.05", "--output", other)
        self.assertEqual(pdf.read_bytes(), other.read_bytes())
        kinescope.markers(ids=7, size=0.05, output=pdf, force=True)
        self.assertNotEqual(pdf.read_bytes(), other.read_bytes())

    def test_a_value_may_begin_like_an_option(self):
        with self.assertRaisesRegex(kinescope.BadInput, "--robot"):
            kinescope.export("--robot", mjcf=scratch() / "none.xml")

    def test_nothing_is_printed(self):
        script = (
            "import kinescope, sys\n"
            f"kinescope.inspect({str(SCARA)!r})\n"
            "try: kinescope.inspect('/nowhere')\n"
            "except kinescope.Error: pass\n"
        )
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
        self.assertEqual((done.stdout, done.stderr), (b"", b""))

    def test_a_folder_with_any_bytes_in_its_name(self):
        folder = os.fsencode(scratch()) + b"/w\xe9rk \xff"
        os.mkdir(folder)
        kinescope.markers(ids=0, size=0.05, output=folder + b"/m.pdf")
        self.assertTrue(os.path.exists(folder + b"/m.pdf"))
        with self.assertRaisesRegex(kinescope.BadRequest, "is there"):
            kinescope.markers(ids=0, size=0.05, output=folder + b"/m.pdf")


class Errors(unittest.TestCase):
    def test_each_exit_code_is_a_class(self):
        with self.assertRaises(kinescope.BadInput) as caught:
            kinescope.run("/nowhere", output=scratch() / "nothing")
        self.assertEqual(caught.exception.exit_code, 3)
        done = run_program("run", "/nowhere", "--output", scratch() / "nothing", code=3)
        self.assertEqual(f"kinescope: {caught.exception}\n", done.stderr.decode())
        with self.assertRaises(kinescope.BadRequest) as caught:
            kinescope.run(SCARA, folds=-1)
        self.assertIsInstance(caught.exception, ValueError)
        self.assertEqual(caught.exception.exit_code, 2)
        for kind in ("BadInput", "BadRequest", "Undetermined", "OutsideLimits", "InternalError"):
            self.assertTrue(issubclass(getattr(kinescope, kind), kinescope.Error))

    def test_outside_limits_still_has_the_result(self):
        result, _ = run_of_sample()
        with self.assertRaisesRegex(kinescope.OutsideLimits, "held_out_px>1e-06") as caught:
            kinescope.run(
                SCARA,
                output=scratch() / "limited",
                no_trace=True,
                folds=2,
                fail_on=["held_out_px>1e-6"],
            )
        self.assertEqual(caught.exception.exit_code, 5)
        self.assertEqual(caught.exception.result["calibration"], result["calibration"])

    def test_undetermined_names_what_to_record(self):
        folder = scratch() / "still"
        shutil.copytree(SCARA, folder)
        rows = (folder / "joints.csv").read_text().splitlines()
        (folder / "joints.csv").write_text(
            "\n".join([rows[0]] + [row.split(",")[0] + ",0,0,0,0" for row in rows[1:]])
        )
        with self.assertRaises(kinescope.Undetermined) as caught:
            kinescope.run(folder, output=scratch() / "still_run", no_trace=True, folds=0)
        self.assertEqual(caught.exception.exit_code, 4)

    def test_a_bad_recording_is_told_with_its_findings(self):
        folder = scratch() / "no_log"
        folder.mkdir()
        with self.assertRaises(kinescope.BadInput) as caught:
            kinescope.inspect(folder)
        self.assertTrue(caught.exception.result["problems"])
        self.assertIn(caught.exception.result["problems"][0], str(caught.exception))

    def test_arguments_of_no_use(self):
        with self.assertRaises(TypeError):
            kinescope.run(SCARA, outptu="x")
        with self.assertRaises(TypeError):
            kinescope.run()
        with self.assertRaises(TypeError):
            kinescope.run(SCARA, output={"a": object()}.values())
        for value in (float("nan"), float("inf"), -1, "two", True, [1, 2], ""):
            with self.assertRaises(kinescope.BadRequest, msg=repr(value)):
                kinescope.run(SCARA, folds=value)
        with self.assertRaisesRegex(kinescope.BadRequest, "code 0"):
            kinescope.run("a\0b")
        with self.assertRaises(kinescope.BadRequest):
            kinescope.run("")

    def test_warnings_are_those_of_python(self):
        folder = scratch() / "odd"
        shutil.copytree(SCARA, folder)
        rows = (folder / "joints.csv").read_text().splitlines()
        rows[5] = rows[5].replace(rows[5].split(",")[1], "x")
        (folder / "joints.csv").write_text("\n".join(rows))
        _, run = run_of_sample()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            kinescope.correct(run, folder / "joints.csv", output=scratch() / "corrected.csv")
        caught = [one for one in caught if one.category is kinescope.InputWarning]
        self.assertEqual({one.filename for one in caught}, {__file__})
        self.assertRegex(str(caught[0].message), "joints.csv")


class Threads(unittest.TestCase):
    def test_other_threads_run_meanwhile(self):
        begun, ended = threading.Event(), threading.Event()
        worker = threading.Thread(
            target=lambda: (
                kinescope.run(
                    SCARA,
                    output=scratch() / "threaded",
                    no_trace=True,
                    folds=2,
                    progress=lambda *_: begun.set(),
                ),
                ended.set(),
            )
        )
        worker.start()
        self.assertTrue(begun.wait(60))
        turns = 0
        while not ended.is_set():
            time.sleep(1e-3)
            turns += 1
        worker.join()
        self.assertGreater(turns, 100)  # a tenth of a second; the lock held: 1
        _, folder = run_of_sample()
        for name in ("calibration.json", "residuals.csv", "robot.urdf"):
            self.assertEqual(
                (folder / name).read_bytes(), (scratch() / "threaded" / name).read_bytes()
            )

    def test_commands_at_once_give_the_same(self):
        expected, found = kinescope.inspect(SCARA), [None] * 4

        def look(i):
            found[i] = kinescope.inspect(SCARA)

        threads = [threading.Thread(target=look, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, [expected] * 4)

    def test_progress_is_told(self):
        told = []
        kinescope.inspect(SCARA, progress=lambda *words: told.append(words))
        self.assertTrue(told)
        self.assertEqual([type(word) for word in told[0]], [str, int, int])

    def test_what_progress_raises_ends_the_command(self):
        folder = scratch() / "stopped"

        def stop(*_):
            raise RuntimeError("enough")

        with self.assertRaisesRegex(RuntimeError, "enough"):
            kinescope.run(SCARA, output=folder, no_trace=True, progress=stop)
        self.assertFalse((folder / "robot.urdf").exists())

    def test_control_c_ends_the_command(self):
        script = (
            "import kinescope, sys\n"
            "told = lambda *_: print('begun', flush=True)\n"
            "try:\n"
            f"    kinescope.run({str(SCARA)!r}, output={str(scratch() / 'ended')!r}, progress=told)\n"
            "except KeyboardInterrupt:\n"
            "    print('interrupted')\n"
        )
        child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
        self.assertEqual(child.stdout.readline(), b"begun\n")
        child.send_signal(signal.SIGINT)
        out, _ = child.communicate(timeout=60)
        self.assertTrue(out.endswith(b"interrupted\n"))
        self.assertEqual(child.returncode, 0)
        self.assertFalse((scratch() / "ended" / "robot.urdf").exists())

    def test_python_s_own_output_is_left_alone(self):
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            kinescope.inspect(SCARA)
            print("mine")
        self.assertEqual((out.getvalue(), err.getvalue()), ("mine\n", ""))


class Version(unittest.TestCase):
    def test_is_the_program_s(self):
        done = subprocess.run([PROGRAM, "--version"], capture_output=True, check=True)
        self.assertEqual(f"kinescope {kinescope.__version__}\n", done.stdout.decode())


if __name__ == "__main__":
    unittest.main()
