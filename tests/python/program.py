# SPDX-License-Identifier: Apache-2.0
"""What the tests of the Python module share: the program, the sample, a run of it."""

import functools
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import kinescope

PROGRAM = os.environ["KINESCOPE_PROGRAM"]
SOURCE = Path(os.environ["KINESCOPE_SOURCE_DIR"])
SCARA = SOURCE / "sample_videos" / "scara4_none"


def run_program(*words, code=0):
    """The finished process; fails for another exit code."""
    done = subprocess.run([PROGRAM, *map(os.fspath, words)], capture_output=True, check=False)
    if done.returncode != code:
        raise AssertionError(f"exit code {done.returncode}, not {code}: {done.stderr.decode()}")
    return done


@functools.cache
def scratch():
    """A folder that is removed when the tests end."""
    holder = tempfile.TemporaryDirectory()
    unittest.addModuleCleanup(holder.cleanup)
    return Path(holder.name)


@functools.cache
def run_of_sample():
    """The result of `kinescope.run` on the sample without effects, and its folder."""
    folder = scratch() / "run"
    return kinescope.run(SCARA, output=folder, no_trace=True, folds=2), folder
