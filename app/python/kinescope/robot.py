# SPDX-License-Identifier: Apache-2.0
"""A calibrated robot, and the products of a run folder, as NumPy arrays."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kinescope
from ._errors import BadInput, BadRequest, InputWarning

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joint:
    """A joint of the tree: ``T_parent_child(q) = T_parent_joint @ motion(axis, q)``."""

    name: str
    type: str  #: "revolute", "prismatic" or "fixed"
    parent: str  #: link
    child: str  #: link; its frame is the joint's after the motion
    T_parent_joint: Array  #: (4, 4)
    axis: Array  #: (3,), unit, in the joint's frame
    channel: str  #: of the log, that drives it; "" where none does
    scale: float  #: rad or m per unit of the channel
    offset: float  #: rad or m
    couplings: Mapping[str, float]  #: further channels that move it, by their ratio
    range: Array  #: (2,), lowest and highest value of the recording, rad or m; NaN: unknown


@dataclass(frozen=True)
class Marker:
    """A marker fixed to a link."""

    id: int
    link: str
    T_link_marker: Array  #: (4, 4); x right, y down, z into the marker
    size: float  #: edge of the black square, m; 0 for a body that is no tag


@dataclass(frozen=True)
class Camera:
    """Intrinsics; zero where no camera was used."""

    width: int  #: px
    height: int  #: px
    K: Array  #: (3, 3), px
    model: str  #: "plumb_bob", "rational_polynomial" or "equidistant", as in ROS and OpenCV
    distortion: Array  #: (4,), (5,) or (8,)
    estimated: bool  #: from the motion of the robot


@dataclass(frozen=True)
class Parameters:
    """What was estimated, in the order of its covariance."""

    names: tuple[str, ...]
    blocks: tuple[str, ...]  #: "joint2", "tag_12", "camera", "clock", ...
    units: tuple[str, ...]
    values: Array  #: (P,); tilts and shifts against the start; NaN: not known
    sigma: Array  #: (P,), standard uncertainty (k = 1), noise correlated in time allowed for
    sigma_white: Array  #: (P,), what independent noise alone would give
    covariance: Array  #: (P, P), in these units


@dataclass(frozen=True)
class Residuals:
    """Observed minus predicted, one row a corner; of poses one row a sighting.

    Columns of corners are (u, v) in px; of poses and points the displacement
    of the body in its frame, rotation (rad), then translation (m).
    """

    t: Array  #: (N,), s, of the frame, on the clock of the frames
    marker: NDArray[np.int64]  #: (N,), id
    corner: NDArray[np.int64]  #: (N,), 0 where a row is a sighting
    used: NDArray[np.bool_]  #: (N,), False: rejected as an outlier
    fold: NDArray[np.int64]  #: (N,), in which its frame was held out; -1: none
    final: Array  #: (N, 2) or (N, 6), of the calibration
    held_out: Array  #: the same of a calibration that had not seen the frame; NaN: none
    before: Array  #: the same of the start; NaN: not stored


@dataclass(frozen=True)
class Tracks:
    """Poses of single markers in the camera's frame, one row a sighting."""

    t: Array  #: (N,), s, on the clock of the frames
    marker: NDArray[np.int64]  #: (N,), id
    T_camera_marker: Array  #: (N, 4, 4)
    sigma_m: Array  #: (N,)
    sigma_rad: Array  #: (N,)


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _numbers(values: Any) -> Array:
    return np.array([_number(value) for value in values], dtype=float)


def _rotations(q: Array) -> Array:
    """Of unit quaternions x, y, z, w: (N, 4) to (N, 3, 3)."""
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=-2,
    )


def _transforms(q: Array, p: Array) -> Array:
    out = np.tile(np.eye(4), (len(q), 1, 1))
    out[:, :3, :3] = _rotations(q)
    out[:, :3, 3] = p
    return out


def _transform(stored: Mapping[str, Any]) -> Array:
    q = _numbers(stored["quaternion_xyzw"])
    return _transforms(q[None], _numbers(stored["translation_m"])[None])[0]


def _joint(stored: Mapping[str, Any]) -> Joint:
    return Joint(
        name=stored["name"],
        type=stored["type"],
        parent=stored["parent"],
        child=stored["child"],
        T_parent_joint=_transform(stored["T_parent_joint"]),
        axis=_numbers(stored["axis"]),
        channel=stored["channel"],
        scale=_number(stored["scale"]),
        offset=_number(stored["offset"]),
        couplings={one["channel"]: one["ratio"] for one in stored.get("couplings", [])},
        range=_numbers(stored.get("range", (None, None))),
    )


def _camera(stored: Mapping[str, Any]) -> Camera:
    fx, fy, cx, cy = (stored[name] for name in ("fx", "fy", "cx", "cy"))
    return Camera(
        width=stored["width"],
        height=stored["height"],
        K=np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=float),
        model=stored["distortion_model"],
        distortion=_numbers(stored["distortion"]),
        estimated=stored["estimated"],
    )


def _parameters(document: Mapping[str, Any]) -> Parameters:
    rows = document["parameters"]
    return Parameters(
        names=tuple(row["name"] for row in rows),
        blocks=tuple(row["block"] for row in rows),
        units=tuple(row["unit"] for row in rows),
        values=_numbers(row["value"] for row in rows),
        sigma=_numbers(row["sigma"] for row in rows),
        sigma_white=_numbers(row["sigma_white"] for row in rows),
        covariance=np.array(document["covariance"], dtype=float).reshape(len(rows), len(rows)),
    )


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: {error} (give the folder of a finished run)") from error


def _table(text: str, source: str | os.PathLike[str]) -> dict[str, Array]:
    """A table with a header; empty cells are NaN. A first column of names (of cameras, of
    recordings) is left out."""
    header, *lines = text.splitlines() or [""]
    names = header.split(",")
    first = 1 if names[0] in ("camera", "recording") else 0
    names = names[first:]
    rows = [[cell or "nan" for cell in line.split(",")[first:]] for line in lines]
    try:
        values = np.array(rows, dtype=float).reshape(len(rows), len(names))
    except ValueError as error:
        raise BadInput(f"{source}: {error} (run the recording again)") from error
    return dict(zip(names, values.T.copy()))


def _columns(table: Mapping[str, Array], names: list[str]) -> Array:
    nothing = np.full(len(table["t"]), np.nan)
    return np.stack([table.get(name, nothing) for name in names], axis=1)


def _residuals(table: Mapping[str, Array]) -> Residuals:
    corners = "tag" in table
    names = ["du", "dv"] if corners else ["rx", "ry", "rz", "x", "y", "z"]
    marker = table["tag" if corners else "body"]
    return Residuals(
        t=table["t"],
        marker=marker.astype(np.int64),
        corner=table.get("corner", np.zeros_like(marker)).astype(np.int64),
        used=table["used"] != 0,
        fold=table["fold"].astype(np.int64),
        final=_columns(table, names),
        held_out=_columns(table, ["held_out_" + name for name in names]),
        before=_columns(table, ["before_" + name for name in names]),
    )


class Calibration:
    """A calibrated robot and its camera, from `calibrate` or, as a `Run`, from a folder.

    Attributes
    ----------
    name: str
        Of the robot.
    status: str
        "converged", "not_converged" or "undetermined"; what is not converged
        is not to be used.
    links: tuple of str
        The first is the root, whose frame is called base.
    joints: tuple of Joint
    moving: tuple of Joint
        Without fixed ones: the columns of joint values ``q``, J of them.
    markers: tuple of Marker
    range: (J, 2) array
        Lowest and highest value of each moving joint in the recording, rad or m.
    T_camera_base: (4, 4) array
    time_offset, time_offset_sigma: float
        s; time of the joint log = time of the frame + offset.
    camera: Camera
    parameters: Parameters
    effects: list of dict
        What tracing found and the calibration holds beside the tree, as in
        calibration.json; `forward` knows nothing of them.
    errors: dict
        Root mean squares: ``before`` (start), ``training``, ``held_out``,
        ``final``, in ``unit`` ("px" or "m").
    document: dict
        calibration.json itself.
    """

    def __init__(self, calibration_json: str, residuals_csv: str, source: str = "calibration"):
        self._robot = _kinescope.Robot(calibration_json, os.fsencode(source))
        self._residuals_csv = residuals_csv
        self.document: dict[str, Any] = json.loads(calibration_json)
        stored = self.document["robot"]
        self.name: str = stored["name"]
        self.status: str = self.document["status"]
        self.links: tuple[str, ...] = tuple(stored["links"])
        self.joints = tuple(_joint(joint) for joint in stored["joints"])
        self.moving = tuple(joint for joint in self.joints if joint.type != "fixed")
        self.markers = tuple(
            Marker(one["id"], one["link"], _transform(one["T_link_marker"]), one["size_m"])
            for one in stored["markers"]
        )
        self.range: Array = np.array([joint.range for joint in self.moving]).reshape(-1, 2)
        self.T_camera_base: Array = _transform(self.document["T_camera_base"])
        self.time_offset = _number(self.document["time_offset_s"])
        self.time_offset_sigma = _number(self.document["time_offset_sigma_s"])
        self.camera = _camera(self.document["camera"])
        self.parameters = _parameters(self.document)
        self.effects: list[dict[str, Any]] = self.document.get("effects", [])
        self.errors: dict[str, Any] = {
            name: _number(self.document[f"{name}_rms"])
            for name in ("before", "training", "held_out", "final")
        }
        self.errors["unit"] = self.document["rms_unit"]

    def __repr__(self) -> str:
        joints = ", ".join(f"{joint.name} ({joint.type})" for joint in self.moving)
        return f"<kinescope.{type(self).__name__} {self.name!r}: {joints}>"

    def forward(self, q: ArrayLike) -> dict[str, Array]:
        """Where the links are.

        Parameters
        ----------
        q: (N, J) or (J,) array
            Values of the `moving` joints, rad or m.

        Returns
        -------
        dict of link name to (N, 4, 4) array
            ``T_base_link``.

        Raises
        ------
        BadRequest
            Another shape, no real numbers, NaN or infinity.
        """
        return dict(zip(self.links, self._robot.forward(q)))

    def jacobian(self, q: ArrayLike, link: str) -> Array:
        """Body Jacobians of a link, (N, 6, J): rotation, then translation, in the link's frame,
        per rad or m: ``T(q + d) = T(q) @ exp(J d)`` to first order. Raises as `forward`."""
        return self._robot.jacobian(q, link)

    @cached_property
    def screws(self) -> Array:
        """(J, 6): axis of each moving joint in the base frame with all joints at zero, as a screw
        (w, v): unit w and v = -w x point (m) for a revolute joint, w = 0 and unit v for a
        prismatic one. ``T_base_link(q) = exp(S1 q1) .. exp(Sn qn) @ T_base_link(0)``
        (Lynch and Park 2017, eq. 4.14)."""
        return self._robot.screws()

    def joint_values(self, readings: Mapping[str, ArrayLike]) -> Array:
        """Values of the moving joints, (N, J), from readings of their channels.

        Parameters
        ----------
        readings: mapping of channel name to (N,) array
            In the units of the recording's log after ``units`` of recording.yaml.
            Effects stay in: `kinescope.correct` takes them out of a log.

        Raises
        ------
        BadRequest
            A channel is missing, arrays of other lengths, or a joint that no channel drives.
        """
        return np.stack([self._value(joint, readings) for joint in self.moving], axis=1)

    @staticmethod
    def _value(joint: Joint, readings: Mapping[str, ArrayLike]) -> Array:
        if not joint.channel:
            raise BadRequest(f"{joint.name}: no channel drives it (its value is not in the log)")
        total: Array | float = 0.0
        for channel, ratio in {joint.channel: 1.0, **joint.couplings}.items():
            if channel not in readings:
                raise BadRequest(f"readings: no '{channel}', which drives {joint.name} (add it)")
            reading = np.asarray(readings[channel], dtype=float)
            if reading.ndim != 1 or np.ndim(total) == 1 and np.shape(total) != reading.shape:
                raise BadRequest(f"readings: '{channel}' has shape {reading.shape} (give (N,))")
            total = total + ratio * reading
        return joint.scale * total + joint.offset

    def project(self, points_base: ArrayLike) -> Array:
        """Pixels, (N, 2), of points in the base frame, (N, 3), m; NaN behind the camera. Raises
        `BadRequest` for a run without a camera or with one that moves (`document`'s
        ``camera_motion``), and as `forward`."""
        if "camera_motion" in self.document:
            raise BadRequest(
                "project: the camera moves (give points in its frame to the camera's own model; "
                "document['camera_motion'] and camera_path.csv say where it is)"
            )
        points = np.asarray(points_base)
        if points.dtype.kind in "biuf" and points.ndim in (1, 2) and points.shape[-1] == 3:
            points = points @ self.T_camera_base[:3, :3].T + self.T_camera_base[:3, 3]
        return self._robot.project(points)

    def marker_corners(self, q: ArrayLike, marker: Marker) -> Array:
        """Corners of a square marker in the base frame, (N, 4, 3), m, in the order of
        observations.csv and `residuals`. Raises as `forward`."""
        half = 0.5 * marker.size
        square = half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
        T = self.forward(q)[marker.link] @ marker.T_link_marker
        return np.einsum("nij,cj->nci", T[:, :3, :3], square) + T[:, None, :3, 3]

    @cached_property
    def residuals(self) -> Residuals:
        """Of every corner, or of poses and points of every sighting."""
        return _residuals(_table(self._residuals_csv, "residuals"))


class Run(Calibration):
    """A finished run, read from its folder: a `Calibration` and its other products.

    Parameters
    ----------
    folder: path
        What `kinescope.run` wrote.

    Raises
    ------
    BadInput
        No run's folder, or its calibration.json is damaged or of another version.

    Attributes
    ----------
    folder: Path
    """

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)
        path = self.folder / "calibration.json"
        super().__init__(_read(path), "", str(path))

    @cached_property
    def residuals(self) -> Residuals:
        """residuals.csv. Raises `BadInput` where it cannot be read."""
        return _residuals(self._table("residuals.csv"))

    @cached_property
    def tracks(self) -> Tracks:
        """tracks.csv. Raises `BadInput` where it cannot be read, as of a run from points."""
        table = self._table("tracks.csv")
        return Tracks(
            t=table["t"],
            marker=table["body"].astype(np.int64),
            T_camera_marker=_transforms(
                _columns(table, ["qx", "qy", "qz", "qw"]), _columns(table, ["x", "y", "z"])
            ),
            sigma_m=table["sigma_m"],
            sigma_rad=table["sigma_rad"],
        )

    @cached_property
    def structure(self) -> dict[str, Any]:
        """structure.json: joints and links with their evidence."""
        return self._json("structure.json")

    @cached_property
    def result(self) -> dict[str, Any]:
        """result.json: the numbers of the report."""
        return self._json("result.json")

    def _table(self, name: str) -> dict[str, Array]:
        return _table(_read(self.folder / name), self.folder / name)

    def _json(self, name: str) -> dict[str, Any]:
        try:
            return json.loads(_read(self.folder / name))
        except ValueError as error:
            raise BadInput(f"{self.folder / name}: {error} (run the recording again)") from error


def calibrate(
    corners: ArrayLike,
    markers: ArrayLike,
    frame_times: ArrayLike,
    joint_values: ArrayLike,
    joint_times: ArrayLike,
    channels: Sequence[str],
    *,
    marker_size: float | Mapping[int, float],
    image_size: tuple[int, int],
    camera: Camera | None = None,
    sigma_px: float = 0.1,
    units: Mapping[str, str] | None = None,
    name: str = "robot",
    folds: int = 5,
    time_offset: bool = True,
    scales: bool = False,
    intrinsics: bool = False,
) -> Calibration:
    """Structure and calibration from arrays, without files.

    What `run` begins with, on measurements of one's own detector. `run` does
    more: cameras that nobody knows, effects that the calibration lacks, a report.

    Parameters
    ----------
    corners: (N, 4, 2) array
        px, of N sightings of square markers; in the marker's frame (x right,
        y down) bottom left, bottom right, top right, top left, as the AprilTag
        library gives them. The centre of the top-left pixel is (0, 0).
    markers: (N,) array of int
        Ids.
    frame_times: (N,) array
        s, of the frame of each sighting; sightings of one frame share it.
    joint_values: (M, C) array
        Readings of C channels: rad or m, or see `units`.
    joint_times: (M,) array
        s, increasing, on the clock of `frame_times` but for a constant.
    channels: C names
    marker_size: float, or mapping of id to float
        Edge of the black square, m.
    image_size: (int, int)
        Width and height, px.
    camera: Camera
        Default: focal length from the markers' shapes, then estimated too.
    sigma_px: float
        Standard deviation of a corner's coordinate, px.
    units: mapping of channel to "rad", "m" or "ticks"
    name: str
        Of the robot.
    folds: int
        Blocks of unseen postures to test on, 0 to 50; 0: none.
    time_offset, scales, intrinsics: bool
        What is estimated, as of `run`.

    Returns
    -------
    Calibration

    Raises
    ------
    BadRequest
        Shapes that do not fit, NaN, times out of order, sizes that are none.
    BadInput
        Markers without a size; no moment in common.
    Undetermined
        The motion does not show the robot, or not this robot.
    """
    seen = np.asarray(corners)
    if seen.ndim != 3 or seen.shape[1:] != (4, 2):
        raise BadRequest(f"corners: has shape {seen.shape} (give (N, 4, 2))")
    ids = {int(one) for one in np.unique(np.asarray(markers)) if np.isfinite(one)}
    sizes = marker_size if isinstance(marker_size, Mapping) else dict.fromkeys(ids, marker_size)
    width, height = (int(length) for length in image_size)
    given = {
        "corners": seen.reshape(-1, 8),
        "markers": markers,
        "frame_times": frame_times,
        "joint_values": joint_values,
        "joint_times": joint_times,
        "channels": list(channels),
        "marker_sizes": {int(one): float(size) for one, size in sizes.items()},
        "width": width,
        "height": height,
        "camera": None
        if camera is None
        else {"K": camera.K, "model": camera.model, "distortion": camera.distortion},
        "sigma_px": float(sigma_px),
        "units": dict(units or {}),
        "name": name,
    }
    text, residuals, told = _kinescope.calibrate(given, folds, intrinsics, time_offset, scales)
    for warning in told:
        warnings.warn(warning, InputWarning, stacklevel=2)
    return Calibration(text, residuals)
