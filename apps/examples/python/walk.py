"""Orientations frame by frame, positions from known rotations, and how good they are.

Run it whole, or cell by cell (# %%) in an editor that knows them. The module is built with the
program: PYTHONPATH=build/release/apps/python python3 apps/examples/python/walk.py
"""

# %% A sequence whose truth is known. Any folder of images or video will do instead.
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import rotslam

program = os.environ.get("ROTSLAM_EXECUTABLE", "build/release/apps/rotslam")
temporary = tempfile.TemporaryDirectory(prefix="rotslam-")
folder = Path(temporary.name)
subprocess.run(
    [program, "simulate", "handheld", "--frames=24", "--width=320", "--height=240", "--quiet",
     f"--out={folder}"],
    check=True)
sequence = rotslam.Sequence(folder)
camera = sequence.camera
print(camera)

# %% One image after the other; a driver's callback would do the same.
odometry = rotslam.Odometry(camera)
orientations = {}
timestamps = []
for image, timestamp in sequence:
    estimate = odometry.add(image, timestamp)
    orientations.update(estimate.window)  # the newest frames still move a little
    timestamps.append(timestamp)
    sigma_deg = (np.degrees(np.sqrt(np.diag(estimate.covariance)))
                 if estimate.covariance is not None else np.zeros(3))
    print(f"{timestamp:.3f}", np.round(estimate.world_from_cam, 5), "sigma, deg:",
          np.round(sigma_deg, 4), *estimate.flags)

# %% How good they are: lines of a TUM trajectory, positions zero.
estimate = np.zeros((len(timestamps), 8))
estimate[:, 0] = timestamps
estimate[:, 4:] = [orientations[frame] for frame in range(len(timestamps))]
metrics = rotslam.evaluate(sequence.ground_truth, estimate, images=len(timestamps))
print("RPE_1 %.4f deg, RPE_n %.4f deg" % (metrics["rpe1"], metrics["rpen"]))

# %% Known rotations: where the cameras were, and the points they saw. A scene of numbers alone.
random = np.random.default_rng(1)
points = random.uniform([-2, -2, 4], [2, 2, 8], (60, 3))
centers = np.column_stack([np.linspace(-1, 1, 6), 0.2 * np.sin(np.arange(6)), np.zeros(6)])
cam_from_world = np.repeat(np.eye(3)[None], 6, axis=0)
view, track = (index.ravel() for index in np.meshgrid(np.arange(6), np.arange(60)))
in_camera = points[track] - centers[view]
pixels = (in_camera[:, :2] / in_camera[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
          + random.normal(0, 0.5, (len(view), 2)))
solution = rotslam.solve_known_rotation(cam_from_world, view, track, pixels, camera)
print(solution["message"])
print("largest residual, px: between %.3f and %.3f" %
      (solution["gamma_low"] * camera.fx, solution["gamma_high"] * camera.fx))
