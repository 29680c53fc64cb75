# SPDX-License-Identifier: Apache-2.0
"""The example draws a picture of a run."""

import importlib.util
import subprocess
import sys
import unittest

from program import SOURCE, run_of_sample, scratch

EXAMPLE = SOURCE / "app" / "examples" / "python" / "draw_run.py"


class Example(unittest.TestCase):
    def test_draws_a_run(self):
        _, folder = run_of_sample()
        picture = scratch() / "run.png"
        subprocess.run([sys.executable, EXAMPLE, folder, picture], check=True)
        content = picture.read_bytes()
        self.assertTrue(content.startswith(b"\x89PNG"))
        self.assertGreater(len(content), 20000)  # bytes; an empty figure of this size has 3000

    def test_says_in_one_line_what_is_no_run(self):
        done = subprocess.run(
            [sys.executable, EXAMPLE, "/nowhere", scratch() / "none.png"],
            capture_output=True,
            check=False,
        )
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr.decode(), r"\Adraw_run.py: .*calibration.json.*\n\Z")


if __name__ == "__main__":
    if importlib.util.find_spec("matplotlib") is None:
        print("SKIPPED: python3-matplotlib is not installed")
        sys.exit(0)
    unittest.main()
