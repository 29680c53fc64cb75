#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The same hyperparameter fit by this library and by scikit-learn (apt: python3-sklearn).

  python3 tests/experiments/gp_against_sklearn.py PROGRAM [SAMPLES ..]

One thread each, the same data, kernel, start and stopping tolerance class; CPU seconds.
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

import resource
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel


# Length scales that end at their bound belong to inputs that do not matter.
warnings.simplefilter("ignore", ConvergenceWarning)


def scikit_learn(data):
    x, y = data[:, :-1], data[:, -1]
    kernel = (ConstantKernel(1.0, (1e-4, 1e4)) * RBF(np.ones(x.shape[1]), (1e-2, 1e3))
              + WhiteKernel(0.1, (1e-8, 1e2)))
    model = GaussianProcessRegressor(kernel, alpha=0.0)
    start = time.process_time()
    model.fit(x, y)
    return model.log_marginal_likelihood_value_, time.process_time() - start


def main():
    program = sys.argv[1]
    for samples in [int(text) for text in sys.argv[2:]] or [1000]:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "data.csv")
            line = subprocess.run([program, str(samples), path, "1"], check=True,
                                  capture_output=True, text=True).stdout.split()
            data = np.loadtxt(path, delimiter=",")
        ours, ours_s, evaluations, core = float(line[2]), float(line[3]), line[5], line[6]
        print(f"N = {samples}, OpenBLAS kernels {core}")
        print(f"  kinescope     log likelihood {ours:12.3f}  CPU {ours_s:8.2f} s"
              f"  ({evaluations} evaluations on all samples)", flush=True)
        theirs, theirs_s = scikit_learn(data)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(f"  scikit-learn  log likelihood {theirs:12.3f}  CPU {theirs_s:8.2f} s"
              f"  (peak memory {peak:.2f} GB)")
        print(f"  ratio {theirs_s / ours_s:.1f}")


if __name__ == "__main__":
    main()
