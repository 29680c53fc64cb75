# SPDX-License-Identifier: Apache-2.0
"""torque_controller.py PREFIX LIBDIR SCRATCH CMAKE GENERATOR CONFIG COMPILER [FLAGS]: the installed example in C++ and
C, built by CMake and by pkg-config, gives the torques of the robot that the model was learned from."""
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

prefix, libdir, scratch = map(Path, sys.argv[1:4])
cmake, generator, config, compiler, *flags = sys.argv[4:]
flags = " ".join(flags)  # CMake leaves an empty argument out
source = prefix / "share/kinescope/examples/torque_controller"
program = prefix / "bin/kinescope"

LINK = ('<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>')
JOINT = ('<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3} 0 0"/>'
         '<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>')
URDF = ('<robot name="arm"><link name="base"/>' + LINK.format("upper", 0.3, 2.0) + LINK.format("lower", 0.2, 1.0)
        + JOINT.format("shoulder", "base", "upper", 0) + JOINT.format("elbow", "upper", "lower", 0.5) + '</robot>')


def output(*command, given=None, code=0):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, input=given)
    assert done.returncode == code, f"{command}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout if code == 0 else done.stderr


def angle(joint, t, derivative):
    """Of sums of two sines, and its derivatives."""
    waves = [(0.9, 1.7 + 0.4 * joint, 0.0), (0.3, 4.3 + 0.7 * joint, 1.0)]
    return sum(a * w**derivative * math.sin(w * t + p + derivative * math.pi / 2) for a, w, p in waves)


def learned_model():
    """The model file, the motion for the example, and the torques that the simulated robot needs for it."""
    times = [i / 100 for i in range(2001)]
    (scratch / "arm.urdf").write_text(URDF)
    (scratch / "path.csv").write_text("t,shoulder,elbow\n" + "".join(
        f"{t},{angle(0, t, 0):.17g},{angle(1, t, 0):.17g}\n" for t in times))
    log = scratch / "log.csv"
    output(program, "simulate", scratch / "arm.urdf", "--trajectory", scratch / "path.csv", "-o", log)
    model = scratch / "torque.json"
    output(program, "dynamics", log, "--robot", scratch / "arm.urdf", "-o", scratch / "out", "--model", "parametric",
           "--no-trace", "--save-model", model)
    header, *rows = log.read_text().splitlines()
    columns = [next(i for i, name in enumerate(header.split(",")) if name.startswith("tau") and name.endswith(joint))
               for joint in ("shoulder", "elbow")]
    samples = [[float(value) for value in row.split(",")] for row in rows[200:-200:37]]
    motion = "".join(" ".join(f"{angle(j, row[0], d):.17g}" for d in range(3) for j in range(2)) + "\n"
                     for row in samples)
    return model, motion, [[row[c] for c in columns] for row in samples]


def built_by_cmake():
    build = scratch / "build"
    output(cmake, "-S", source, "-B", build, "-G", generator, f"-DCMAKE_PREFIX_PATH={prefix}",
           f"-DCMAKE_BUILD_TYPE={config}", f"-DCMAKE_CXX_COMPILER={compiler}", f"-DCMAKE_CXX_FLAGS={flags}",
           f"-DCMAKE_C_FLAGS={flags}")
    output(cmake, "--build", build, "--config", config)
    return [build / "torque_controller", build / "torque_controller_c"]


def built_by_pkg_config():
    pkg_config = ["pkg-config", "--cflags", "--libs", "kinescope_torque"]
    os.environ["PKG_CONFIG_PATH"] = f"{libdir}/pkgconfig"
    words = flags.split() + output(*pkg_config).split()
    c = [compiler, "-x", "c"] if "-fsanitize" in flags or not shutil.which("cc") else ["cc"]
    output(compiler, "-std=c++20", source / "torque_controller.cpp", *words, "-o", scratch / "by_pkg_config")
    output(*c, source / "torque_controller.c", "-x", "none", *words, "-o", scratch / "by_pkg_config_c")
    return [scratch / "by_pkg_config", scratch / "by_pkg_config_c"]


def check_libraries(built):
    """Nothing of solvers, learners and images."""
    needed = [line.split()[-1] for line in output("readelf", "-d", built).splitlines() if "(NEEDED)" in line]
    assert needed, f"{built}: readelf tells nothing"
    for word in ("blas", "lapack", "ceres", "dlib", "svm", "opencv", "apriltag", "urdf", "yaml"):
        assert not any(word in library for library in needed), f"{built} needs {needed}"


shutil.rmtree(scratch, ignore_errors=True)
scratch.mkdir(parents=True)
model, motion, torques = learned_model()
bad = scratch / "bad.json"
bad.write_text('{"schema": "kinescope.torque_model", "schema_version": 1}')
tables = []
for built in built_by_cmake() + built_by_pkg_config():
    check_libraries(built)
    tables.append(output(built, model, given=motion))
    assert "is missing" in output(built, bad, code=3)
assert len(set(tables)) == 1, "C++ and C, CMake and pkg-config differ"
rows = [[float(value) for value in line.split()] for line in tables[0].splitlines()]
assert len(rows) == len(torques) > 40, f"{len(rows)} rows of {len(torques)}"
largest = max(abs(value) for row in torques for value in row)
TOLERANCE = 1e-6  # of the largest torque; measured below 1e-7: the log has ten digits
for row, expected in zip(rows, torques):
    for joint in range(2):
        error = abs(row[joint] - expected[joint])
        assert error < TOLERANCE * largest, f"joint {joint}: {row[joint]} Nm in place of {expected[joint]}"
        assert 0 < row[2 + joint] < math.inf
