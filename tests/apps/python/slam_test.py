"""The whole system from Python, against the program."""
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rotslam

PROGRAM = os.environ["ROTSLAM_EXECUTABLE"]
EXAMPLE = Path(__file__).parents[3] / "apps/examples/python/run.py"
STAGES = ["orientations", "tracks", "known_rotation", "bundle_adjustment", "pure_rotation",
          "frame_registration", "cloud"]


def run_program(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True)


class Run(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.sequence = cls.folder / "sequence"
        run_program("simulate", "handheld", "--frames=24", "--width=320", "--height=240",
                    "--quiet", "--out", cls.sequence)
        run_program("run", cls.sequence, "--quiet", "--no-report", "--out", cls.folder / "run")
        cls.expected = np.loadtxt(cls.folder / "run/trajectory_tum.txt")
        cls.frames = list(rotslam.Sequence(cls.sequence))
        cls.camera = rotslam.Sequence(cls.sequence).camera
        cls.steps = []
        cls.result = rotslam.run(cls.sequence, cls.camera, threads=2,
                                 progress=lambda *step: cls.steps.append(step))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_gives_what_the_program_gives(self):
        result = self.result
        self.assertEqual(result.trajectory.shape, (24, 8))
        np.testing.assert_allclose(result.trajectory, self.expected, rtol=0, atol=1e-9)
        result.write_trajectory(self.folder / "trajectory.txt")
        result.write_ply(str(self.folder / "cloud.ply"))
        np.testing.assert_array_equal(np.loadtxt(self.folder / "trajectory.txt"), self.expected)
        self.assertEqual((self.folder / "cloud.ply").read_bytes(),
                         (self.folder / "run/cloud.ply").read_bytes())
        self.assertIsNone(result.failure)
        self.assertFalse(result.interrupted or result.is_pure_rotation)

    def test_parts_of_the_result(self):
        result = self.result
        np.testing.assert_array_equal(result.timestamps, result.trajectory[:, 0])
        np.testing.assert_array_equal(result.positions, result.trajectory[:, 1:4])
        np.testing.assert_array_equal(result.orientations, result.trajectory[:, 4:])
        self.assertGreater(len(result.points), 100)
        self.assertEqual(result.colours.shape, result.points.shape)
        self.assertEqual(result.colours.dtype, np.uint8)
        self.assertGreater(result.colours.std(), 1)
        keyframes = np.loadtxt(self.folder / "run/keyframes_tum.txt")[:, 0]
        np.testing.assert_allclose(result.timestamps[result.keyframes], keyframes, atol=1e-9)
        self.assertEqual(sorted(sum(result.components, [])), result.keyframes)
        self.assertEqual(result.segments, [])
        self.assertEqual((result.camera.width, result.camera.height), (320, 240))
        self.assertIn("24 frames", repr(result))
        metrics = rotslam.evaluate(self.sequence / "groundtruth_tum.txt", result.trajectory)
        self.assertLess(metrics["rpe1"], 0.2)

    def test_progress(self):
        self.assertEqual([stage for stage, step, _ in self.steps if step == 0], STAGES)
        self.assertEqual([step for stage, step, _ in self.steps if stage == "orientations"],
                         list(range(25)))
        self.assertEqual(self.steps[0], ("orientations", 0, 24))

    def test_live_session(self):
        slam = rotslam.LiveSlam(self.camera, keep_images=True)
        self.assertIsNone(slam.map())
        poses = [slam.add(image, timestamp) for image, timestamp in self.frames]
        self.assertEqual((poses[0].state, poses[0].position), ("starting", None))
        self.assertEqual(poses[-1].state, "tracking")
        self.assertEqual(poses[-1].position.shape, (3,))
        live_map = slam.map()
        self.assertEqual(live_map.revision, poses[-1].revision)
        self.assertGreater(len(live_map.points), 100)
        self.assertEqual(live_map.positions.shape, (len(live_map.keyframes), 3))
        np.testing.assert_array_equal(slam.finish().trajectory, self.result.trajectory)
        with self.assertRaises(ValueError):
            slam.add(None, 1e9)

    def test_images_in_memory(self):
        result = rotslam.run(self.frames, self.camera)
        np.testing.assert_array_equal(result.trajectory, self.result.trajectory)
        np.testing.assert_array_equal(result.points, self.result.points)
        lost = [(None if k == 11 else image, time) for k, (image, time) in enumerate(self.frames)]
        result = rotslam.run(lost, self.camera)
        self.assertEqual(len(result.trajectory), 24)
        self.assertIsNone(result.failure)

    def test_sequences_already_read_and_cut(self):
        sequence = rotslam.Sequence(self.sequence, last=11)
        next(sequence)
        result = rotslam.run(sequence)
        np.testing.assert_allclose(result.timestamps, self.expected[:12, 0], atol=1e-9)

    def test_without_a_camera_estimates_the_lens(self):
        bare = self.folder / "bare"
        (self.sequence / "rgb").rename(bare)
        try:
            passes = []
            result = rotslam.run(bare, progress=lambda stage, step, _: passes.append((stage, step)))
        finally:
            bare.rename(self.sequence / "rgb")
        self.assertGreater(passes.count(("orientations", 0)), 1)
        self.assertEqual(len(result.trajectory), 24)

    def test_stops_when_progress_says_no(self):
        result = rotslam.run(self.frames, self.camera, progress=lambda _, step, __: step < 9)
        self.assertTrue(result.interrupted)
        self.assertEqual(result.trajectory.shape, (9, 8))
        self.assertEqual(result.points.shape, (0, 3))
        self.assertIn("stopped", result.failure)

    def test_exceptions_of_progress_reach_the_caller(self):
        def fail(stage, step, num_steps):
            if step == 3:
                raise KeyError("enough")

        with self.assertRaisesRegex(KeyError, "enough"):
            rotslam.run(self.frames, self.camera, progress=fail)

    def test_options_reach_every_stage(self):
        few = rotslam.run(self.frames, self.camera, {"cloud_min_angle_deg": 5.0})
        self.assertLess(len(few.points), len(self.result.points))
        with self.assertRaisesRegex(ValueError, "cloud_min_angle_deg"):
            rotslam.run(self.frames, self.camera, {"cloud_min_angle_deg": -1.0})
        with self.assertRaisesRegex(ValueError, "no option is called"):
            rotslam.run(self.frames, self.camera, {"ba": {"nothing": 1}})

    def test_a_camera_that_does_not_move(self):
        image = self.frames[0][0]
        result = rotslam.run([(image, 0.1 * k) for k in range(12)], self.camera)
        self.assertTrue(result.is_pure_rotation)
        self.assertIsNone(result.failure)
        self.assertEqual(result.segments, [(0, 11)])
        np.testing.assert_array_equal(result.positions, np.zeros((12, 3)))

    def test_wrong_arguments_are_refused(self):
        image = self.frames[0][0]
        for arguments, error, text in (
                ((self.frames,), ValueError, "needs a camera"),
                (([image], self.camera), ValueError, "sequence must be"),
                (([(image[:-1], 0)], self.camera), ValueError, "image of frame 0 must have"),
                (([(image, 0), (image, 0)], self.camera), ValueError, "timestamp of frame 1"),
                (([(image, 0)], self.camera), RuntimeError, "only 1 frames"),
                ((self.folder / "nowhere",), RuntimeError, "nowhere"),
                ((self.sequence, self.camera, None, 3), ValueError, "progress must be")):
            with self.assertRaisesRegex(error, text):
                rotslam.run(*arguments)
        with self.assertRaisesRegex(ValueError, "threads is 0"):
            rotslam.run(self.frames, self.camera, threads=0)

    def test_example(self):
        cloud, trajectory = self.folder / "example.ply", self.folder / "example.txt"
        subprocess.run([sys.executable, EXAMPLE, self.sequence, self.sequence / "camera.yaml",
                        cloud, trajectory], check=True, capture_output=True)
        np.testing.assert_array_equal(np.loadtxt(trajectory), self.expected)
        self.assertGreater(cloud.stat().st_size, 1000)


if __name__ == "__main__":
    unittest.main()
