# SPDX-License-Identifier: Apache-2.0
"""Saved torque models on arrays."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kinescope
from ._errors import BadRequest, InputWarning

Array = NDArray[np.float64]


class TorquePrediction(NamedTuple):
    """What a model says of samples, in the model's unit."""

    torque: Array  #: (N, J), what the actuators apply
    sigma: Array  #: (N, J), standard deviation of a new measurement about it


@dataclass(frozen=True)
class TorqueLog:
    """A log as the samples that the model is asked about: N of them, J joints."""

    t: Array  #: (N,), s; increases within a trajectory
    trajectory: NDArray[np.int32]  #: (N,), number of the uninterrupted motion
    q: Array  #: (N, J), rad or m
    qd: Array  #: (N, J), rad/s or m/s
    qdd: Array  #: (N, J), rad/s^2 or m/s^2
    torque: Array  #: (N, J), measured


class TorqueModel:
    """A learned torque model, from a file of ``kinescope.dynamics(..., save_model=file)``.

    Parameters
    ----------
    path: path

    Raises
    ------
    BadInput
        No such file, or of another version, or damaged.

    Attributes
    ----------
    kind: str
        "parametric", "gip", "semi_parametric", ...
    robot: str
    joints: tuple of str
        The columns of all arrays, J of them.
    unit: str
        Of torques: "Nm" (N for prismatic joints) or "A".
    samples: int
        Learned from.
    traced: bool
        Tracing found effects, which have a memory: see `predict`.
    """

    def __init__(self, path: str | os.PathLike[str]):
        self.path = os.fspath(path)
        self._model = _kinescope.SavedModel(os.fsencode(path))
        facts = self._model.facts()
        self.kind: str = facts["kind"]
        self.robot: str = facts["robot"]
        self.joints: tuple[str, ...] = tuple(facts["joints"])
        self.unit: str = facts["unit"]
        self.samples: int = facts["samples"]
        self.traced: bool = facts["traced"]

    def __repr__(self) -> str:
        return f"<kinescope.TorqueModel {self.path!r}: {self.kind} of {self.robot}>"

    def predict(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        *,
        t: ArrayLike | None = None,
        trajectory: ArrayLike | None = None,
        traced: bool = False,
        threads: int = 0,
    ) -> TorquePrediction:
        """Torques that the motion takes.

        Parameters
        ----------
        q, qd, qdd: (N, J) or (J,) arrays
            Positions (rad, m), velocities and accelerations (per s, per s^2).
        t: (N,) array
            s; with ``traced`` only, where it must increase within a trajectory.
        trajectory: (N,) array of whole numbers
            With ``traced`` only; default: all samples are one motion.
        traced: bool
            With the effects that tracing found. These have a memory (friction
            that creeps, a payload that is picked up): samples are motions, not
            single ones. ``kinescope predict`` does so where the model has some.
        threads: int
            0: all of the machine. Never changes a result.

        Raises
        ------
        BadRequest
            Another shape, no real numbers, NaN or infinity; times that are
            missing, too many, or not in order; ``traced`` of a model without
            effects.
        """
        if traced:
            if t is None:
                raise BadRequest("t: is missing (effects have a memory: give every sample's time)")
            return TorquePrediction(*self._model.predict_traced(q, qd, qdd, t, trajectory))
        if t is not None or trajectory is not None:
            raise BadRequest("t, trajectory: single samples need none (say traced=True)")
        return TorquePrediction(*self._model.predict(q, qd, qdd, threads))

    @property
    def band90(self) -> Array:
        """(J,): half the width of a band that holds 90 % of new measurements, in sigmas of
        `predict` without ``traced``."""
        return self._model.bands()[0]

    @property
    def band95(self) -> Array:
        """(J,): the same for 95 %."""
        return self._model.bands()[1]

    def read_log(
        self,
        logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
        *,
        settings: str | os.PathLike[str] | None = None,
    ) -> TorqueLog:
        """Logs as ``kinescope predict`` takes them: the model's joints by name, the low-pass of the
        log that it was learned from. ``settings``: as of the commands (default: recording.yaml
        beside the first log). What is odd about them is an `InputWarning`.

        Raises
        ------
        BadInput
            A log that cannot be read, without the joints, or in another unit.
        """
        if isinstance(logs, (str, bytes, os.PathLike)):
            logs = [logs]
        file = None if settings is None else os.fsencode(settings)
        read = self._model.read_log([os.fsencode(log) for log in logs], file)
        for warning in read.pop("warnings"):
            warnings.warn(warning, InputWarning, stacklevel=2)
        return TorqueLog(**read)
