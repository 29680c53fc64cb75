#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws a run: draw_run.py RUN_FOLDER PICTURE.png

Left links and markers in the base frame, in three postures of the recording
(the darkest with the joints' axes); right the residuals of the calibration, by marker.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import kinescope


def draw_robot(axes, run):
    postures = np.linspace(run.range[:, 0], run.range[:, 1], 3)
    poses = run.forward(postures)
    for i, shade in enumerate((0.3, 0.6, 1.0)):
        for joint in run.joints:
            ends = np.stack([poses[joint.parent][i, :3, 3], poses[joint.child][i, :3, 3]])
            axes.plot(*ends.T, color="tab:blue", alpha=shade, lw=3)
        for marker in run.markers:
            corners = run.marker_corners(postures[i], marker)[0]
            axes.plot(*corners[[0, 1, 2, 3, 0]].T, color="tab:orange", alpha=shade)
    length = 0.1 * np.ptp([pose[:, :3, 3] for pose in poses.values()])
    for joint in run.moving:
        T = poses[joint.child][-1]
        direction = T[:3, :3] @ joint.axis  # which the joint's own motion does not move
        ends = T[:3, 3] + length * np.array([-direction, direction])
        axes.plot(*ends.T, color="black", ls="--", lw=1)
        axes.text(*ends[1], joint.name)
    axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m", title=f"{run.name} (base frame)")
    axes.set_aspect("equal")


def draw_residuals(axes, run):
    rows = run.residuals
    for marker in np.unique(rows.marker):
        mine = rows.used & (rows.marker == marker)
        axes.plot(*rows.final[mine].T, ".", ms=2, label=f"marker {marker}")
    rms = run.errors["final"]
    axes.set(xlabel="u, px", ylabel="v, px", title=f"residuals, {rms:.3f} px rms", aspect="equal")
    axes.invert_yaxis()  # as in the image
    axes.legend(markerscale=4)


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: draw_run.py RUN_FOLDER PICTURE.png")
    try:
        run = kinescope.Run(sys.argv[1])
        figure = plt.figure(figsize=(11, 5), layout="constrained")
        draw_robot(figure.add_subplot(1, 2, 1, projection="3d"), run)
        draw_residuals(figure.add_subplot(1, 2, 2), run)
    except kinescope.Error as error:
        sys.exit(f"draw_run.py: {error}")
    figure.savefig(sys.argv[2], dpi=120)


if __name__ == "__main__":
    main()
