#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
#
# The MAT-files of ../data by SciPy 1.10.1: write_mat.py DATA. The test knows the formulas.
import pathlib
import sys

import numpy as np
from scipy.io import savemat

data = pathlib.Path(sys.argv[1])
i, j = np.arange(50)[:, None], np.arange(2)[None, :]
log = {
    "t": 0.01 * np.arange(50),
    "q": np.sin(0.3 * i + j),
    "dq": (0.3 * np.cos(0.3 * i + j)).T,  # joints x samples
    "tau": (0.5 * np.sin(0.1 * i * (j + 1))).astype(np.float32),
    "mode": (i[:, 0] % 7).astype(np.uint8),
    "gains": np.array([[1.0, 2.0, 3.0]]),
    "robot": "arm",
    "settings": {"rate": 100.0},
    "z": np.array([1 + 2j, 3.0]),
    "cube": np.zeros((2, 2, 2)),
}
savemat(data / "log_v6.mat", log, do_compression=False)
savemat(data / "log_v7.mat", log, do_compression=True)
