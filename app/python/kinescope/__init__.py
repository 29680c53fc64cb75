# SPDX-License-Identifier: Apache-2.0
"""Kinescope: a robot's body, learned from a video of markers and a joint log.

Every command of the program is a function (`run`, `inspect`, `dynamics`, ...):
its options are keyword arguments, its result is what ``--json`` prints, as a
dict. `Run` has the products of a run folder as NumPy arrays, `calibrate` makes
a calibration of arrays, `TorqueModel` predicts torques from a file of
``dynamics(..., save_model=...)``.

Units are SI (m, rad, s, N m) and px. ``T_a_b`` maps coordinates in b to
coordinates in a. Tangents and screws are (rotation, translation), in that
order. Camera: x right, y down, z forward; the centre of the top-left pixel is
(0, 0). Arrays that come back are copies.

    >>> import kinescope
    >>> result = kinescope.run("recording", output="recording_run")
    >>> robot = kinescope.Run("recording_run")
    >>> robot.forward(robot.range.mean(axis=1))["link3"]    # T_base_link, (1, 4, 4)

Errors are subclasses of `Error`, one for each exit code. What is odd about an
input is a Python warning, `InputWarning`. Nothing is printed, and other
threads run meanwhile.
"""

from ._errors import (
    BadInput,
    BadRequest,
    Error,
    InputWarning,
    InternalError,
    OutsideLimits,
    Undetermined,
)
from ._kinescope import __version__
from .commands import *  # noqa: F403: every command of the program
from .commands import __all__ as _commands
from .robot import (
    Calibration,
    Camera,
    Joint,
    Marker,
    Parameters,
    Residuals,
    Run,
    Tracks,
    calibrate,
)
from .torque import TorqueLog, TorqueModel, TorquePrediction

__all__ = [
    "BadInput",
    "BadRequest",
    "Calibration",
    "Camera",
    "Error",
    "InputWarning",
    "InternalError",
    "Joint",
    "Marker",
    "OutsideLimits",
    "Parameters",
    "Residuals",
    "Run",
    "TorqueLog",
    "TorqueModel",
    "TorquePrediction",
    "Tracks",
    "Undetermined",
    "__version__",
    "calibrate",
    *_commands,
]
