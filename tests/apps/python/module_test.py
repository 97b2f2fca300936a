"""The Python module against the program and against scenes whose truth is known."""
import ast
import json
import os
import subprocess
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np
import rotslam

PROGRAM = os.environ["ROTSLAM_EXECUTABLE"]


def run_program(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True).stdout


def rows_of(orientations, timestamps):
    rows = np.zeros((len(timestamps), 8))
    rows[:, 0] = timestamps
    rows[:, 4:] = [orientations[frame] for frame in range(len(timestamps))]
    return rows


class OnASequence(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.sequence = cls.folder / "sequence"
        run_program("simulate", "handheld", "--frames=24", "--width=320", "--height=240",
                    "--quiet", "--out", cls.sequence)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def add_all(self, **odometry_options):
        sequence = rotslam.Sequence(self.sequence)
        odometry = rotslam.Odometry(sequence.camera, **odometry_options)
        orientations, timestamps, last = {}, [], None
        for image, timestamp in sequence:
            last = odometry.add(image, timestamp)
            np.testing.assert_array_equal(last.window[len(timestamps)], last.world_from_cam)
            orientations.update(last.window)
            timestamps.append(timestamp)
        self.assertEqual(odometry.num_frames, sequence.num_frames)
        return orientations, timestamps, last

    def test_same_orientations_as_the_program(self):
        run_program("rotations", self.sequence, "--no-loops", "--quiet", "--out",
                    self.folder / "rotations")
        expected = np.loadtxt(self.folder / "rotations/rotations_tum.txt")
        orientations, timestamps, last = self.add_all(threads=2)
        found = rows_of(orientations, timestamps)
        self.assertEqual(found.shape, expected.shape)
        np.testing.assert_allclose(found[:, 4:], expected[:, 4:], rtol=0, atol=1e-12)
        self.assertEqual(last.covariance.shape, (3, 3))
        self.assertTrue(np.all(np.linalg.eigvalsh(last.covariance) > 0))
        np.testing.assert_allclose(last.covariance, last.covariance.T)

    def test_options_reach_the_odometry(self):
        plain, _, _ = self.add_all()
        other, _, _ = self.add_all(options={"averaging": {"mode": "off"}})
        self.assertGreater(np.abs(plain[23] - other[23]).max(), 1e-9)

    def test_loops_are_those_of_the_program(self):
        # A turn there and back, so that the camera sees the first places again.
        there = self.folder / "there"
        run_program("simulate", "gimbal", "--frames=24", "--width=320", "--height=240", "--quiet",
                    "--out", there)
        images = [image for image, _ in rotslam.Sequence(there)]
        camera = rotslam.Sequence(there).camera
        images += images[-2::-1]
        options = {"loop": {"place_overlap": 0.95, "candidates": {"recent_frames": 4}}}
        folder = self.folder / "back"
        folder.mkdir()
        files = sorted((there / "rgb").iterdir())
        for frame, file in enumerate(files + files[-2::-1]):
            os.link(file, folder / f"{10000 + frame}.png")
        (self.folder / "loops.yaml").write_text(json.dumps(options))
        run_program("rotations", folder, "--camera", there / "camera.yaml", "--config",
                    self.folder / "loops.yaml", "--quiet", "--out", self.folder / "looped")
        expected = np.loadtxt(self.folder / "looped/loops.csv", delimiter=",", skiprows=1)
        odometry = rotslam.LoopedOdometry(camera, options=options, threads=2)
        loops, has_averaged = [], False
        for frame, image in enumerate(images):
            estimate = odometry.add(image, frame / 30)
            loops += estimate.loops
            has_averaged |= estimate.has_averaged
        loops += odometry.finish()
        self.assertGreater(sum(loop.accepted for loop in loops), 0)
        np.testing.assert_allclose(loops, expected, rtol=1e-4, atol=1e-4)
        found = odometry.orientations
        np.testing.assert_allclose(
            found, np.loadtxt(self.folder / "looped/rotations_tum.txt")[:, 4:], rtol=0, atol=1e-9)
        self.assertEqual(odometry.covariances.shape, (odometry.num_frames, 3, 3))
        edges = odometry.edges
        pairs = set(zip(edges["i"], edges["j"]))
        for loop in loops:
            if loop.edges > 0:
                self.assertIn((loop.match, loop.frame), pairs)
        averaged = rotslam.average_rotations(*(edges[name] for name in ("i", "j", "j_from_i")),
                                             covariance=edges["covariance"])
        self.assertEqual(averaged["cam_from_world"].shape, (len(images), 3, 3))
        with self.assertRaisesRegex(ValueError, "no frame can follow"):
            odometry.add(images[0], 100)
        self.assertEqual(odometry.finish(), [])
        with self.assertRaisesRegex(ValueError, "the nearest one is"):
            rotslam.LoopedOdometry(camera, options={"loop": {"use_loop": False}})
        with self.assertRaisesRegex(RuntimeError, "none.bin"):
            rotslam.LoopedOdometry(camera, vocabulary=self.folder / "none.bin")

    def test_evaluate_gives_the_numbers_of_eval(self):
        orientations, timestamps, _ = self.add_all()
        rows = rows_of(orientations, timestamps)
        file = self.folder / "estimate.txt"
        np.savetxt(file, rows, fmt="%.17g")
        truth = self.sequence / "groundtruth_tum.txt"
        expected = json.loads(run_program("eval", truth, file, "--images", 24, "--json"))
        self.assertEqual(rotslam.evaluate(truth, file, images=24), expected)
        self.assertEqual(rotslam.evaluate(str(truth), rows, images=24), expected)
        self.assertIsNone(expected["ate"])
        self.assertEqual(expected["coverage"], 1.0)
        with self.assertRaisesRegex(RuntimeError, "poses have ground truth in"):
            rotslam.evaluate(truth, rows + np.eye(8)[0] * 1e6)
        with self.assertRaisesRegex(RuntimeError, "none.txt"):
            rotslam.evaluate(truth, self.folder / "none.txt")
        with self.assertRaisesRegex(ValueError, r"estimate must be .* \[n, 8\].*\(24, 7\)"):
            rotslam.evaluate(truth, rows[:, :7])
        with self.assertRaisesRegex(ValueError, "images is -1"):
            rotslam.evaluate(truth, rows, images=-1)
        with self.assertRaisesRegex(ValueError, "timestamps must ascend"):
            rotslam.evaluate(truth, rows[::-1])

    def test_wrong_images_are_refused_and_do_no_harm(self):
        sequence = rotslam.Sequence(self.sequence)
        odometry = rotslam.Odometry(sequence.camera)
        image, timestamp = next(sequence)
        for wrong in (image.astype(float), image.astype(np.int8), image[:-1], image[:, :, None],
                      image.tolist()):
            with self.assertRaisesRegex(ValueError, "image must"):
                odometry.add(wrong, timestamp)
        with self.assertRaisesRegex(ValueError, "timestamp is nan"):
            odometry.add(image, float("nan"))
        odometry.add(image, timestamp)
        with self.assertRaisesRegex(ValueError, "must be above the last one"):
            odometry.add(image, timestamp)
        self.assertEqual(odometry.num_frames, 1)
        self.assertIn("predicted", odometry.add(None, timestamp + 0.1).flags)

    def test_images_may_be_views_and_may_change_afterwards(self):
        expected, _, _ = self.add_all()
        sequence = rotslam.Sequence(self.sequence)
        odometry = rotslam.Odometry(sequence.camera)
        buffer = np.zeros((240, 640), np.uint8)
        found = {}
        for image, timestamp in sequence:
            buffer[:, ::2] = image
            found.update(odometry.add(buffer[:, ::2], timestamp).window)
            buffer[:] = 0
        for frame, quaternion in expected.items():
            np.testing.assert_array_equal(found[frame], quaternion)

    def test_other_threads_run_meanwhile(self):
        frames = list(rotslam.Sequence(self.sequence))
        camera = rotslam.Sequence(self.sequence).camera
        ticks = []
        done = threading.Event()

        def tick():
            while not done.is_set():
                ticks.append(None)
                done.wait(0.001)

        ticker = threading.Thread(target=tick)
        odometry = rotslam.Odometry(camera)
        ticker.start()
        # A call that kept the lock would let the other thread in between calls only.
        during = 0
        for image, timestamp in frames:
            before = len(ticks)
            odometry.add(image, timestamp)
            during = max(during, len(ticks) - before)
        done.set()
        ticker.join()
        self.assertGreater(during, 3)

    def test_calibrations_without_a_size(self):
        file = self.folder / "calib.txt"
        file.write_text("P0: 250 0 160 0 0 250 120 0 0 0 1 0\n")
        with self.assertRaisesRegex(ValueError, "give read_camera the width and height"):
            rotslam.Odometry(rotslam.read_camera(file))
        self.assertEqual(rotslam.read_camera(file, 320, 240).width, 320)
        given = rotslam.read_camera(self.sequence / "camera.yaml")
        scaled = rotslam.read_camera(self.sequence / "camera.yaml", 640, 480)
        self.assertAlmostEqual(scaled.fx, 2 * given.fx)
        with self.assertRaisesRegex(RuntimeError, "640"):
            rotslam.read_camera(self.sequence / "camera.yaml", 640, 400)

    def test_world_errors_are_runtime_errors(self):
        with self.assertRaisesRegex(RuntimeError, "nowhere"):
            rotslam.Sequence(self.folder / "nowhere")
        with self.assertRaisesRegex(RuntimeError, "nowhere.yaml"):
            rotslam.read_camera(self.folder / "nowhere.yaml")


class OptionsAndCameras(unittest.TestCase):
    camera = rotslam.Camera(fx=250, fy=250, cx=160, cy=120, width=320, height=240)

    def refusal(self, **options):
        with self.assertRaises(ValueError) as context:
            rotslam.Odometry(self.camera, **options)
        return str(context.exception)

    def test_wrong_options(self):
        self.assertIn('nearest one is "averaging.mode"',
                      self.refusal(options={"averaging": {"mod": "off"}}))
        self.assertIn("averaging.mode", self.refusal(options={"averaging": {"mode": "of"}}))
        self.assertIn('"features.max_features" expects a whole number, found 1.5',
                      self.refusal(options={"features": {"max_features": 1.5}}))
        self.assertIn("a whole number", self.refusal(options={"features": {"max_features": 10**30}}))
        self.assertIn("a whole number", self.refusal(options={"features": {"max_features": True}}))
        self.assertIn('"averaging" is a group', self.refusal(options={"averaging": 3}))
        self.assertIn('"averagin"', self.refusal(options={"averagin": {}}))
        self.assertIn("must be a dict", self.refusal(options=[1]))
        self.assertIn("threads is 0", self.refusal(threads=0))

    def test_cameras(self):
        camera = rotslam.Camera(250, 251, 160, 120, 320, 240, "radtan", [0.1, 0.2])
        self.assertEqual((camera.model, camera.fy, camera.distortion),
                         ("radtan", 251, [0.1, 0.2, 0, 0, 0]))
        rational = rotslam.Camera(250, 251, 160, 120, 320, 240, "rational",
                                  [3.1, 1.4, 0, 0, 0.06, 3.4, 2.2, 0.32])
        self.assertEqual(rational.distortion, [3.1, 1.4, 0, 0, 0.06, 3.4, 2.2, 0.32])
        fov = rotslam.Camera(250, 251, 160, 120, 320, 240, "fov", [0.9])
        self.assertEqual((fov.model, fov.distortion), ("fov", [0.9, 0, 0, 0, 0]))
        upright = rotslam.Camera(250, 250, 120, 160, 240, 320, readout_s=0.02, readout_from="right")
        self.assertEqual((upright.readout_s, upright.readout_from), (0.02, "right"))
        for wrong in ({"fx": -1}, {"model": "fisheye"}, {"distortion": [0] * 6},
                      {"readout_from": "up"}):
            with self.assertRaises(ValueError):
                rotslam.Camera(**{"fx": 250, "fy": 250, "cx": 160, "cy": 120, "width": 320,
                                  "height": 240, **wrong})


class KnownRotations(unittest.TestCase):
    camera = rotslam.Camera(fx=700, fy=700, cx=640, cy=480, width=1280, height=960)

    def scene(self, noise_px):
        random = np.random.default_rng(3)
        points = random.uniform([-3, -2, 5], [3, 2, 9], (80, 3))
        centers = np.column_stack([np.linspace(0, 2, 7), 0.3 * np.sin(np.arange(7)),
                                   0.2 * np.cos(np.arange(7))])
        angles = 0.05 * np.arange(7)
        cam_from_world = np.array([[[np.cos(a), 0, -np.sin(a)], [0, 1, 0],
                                    [np.sin(a), 0, np.cos(a)]] for a in angles])
        view, track = (index.ravel() for index in np.meshgrid(np.arange(7), np.arange(80)))
        in_camera = np.einsum("kij,kj->ki", cam_from_world[view], points[track] - centers[view])
        pixels = 700 * in_camera[:, :2] / in_camera[:, 2:] + [640, 480]
        pixels += random.uniform(-noise_px, noise_px, pixels.shape)
        # In no order, and ids with gaps.
        order = random.permutation(len(view))
        return (centers, points,
                (cam_from_world, view[order], 10 * track[order] + 3, pixels[order], self.camera))

    def test_clean_scene(self):
        centers, points, arguments = self.scene(0)
        solution = rotslam.solve_known_rotation(*arguments)
        self.assertEqual(solution["status"], "converged")
        # Origin and scale are free.
        scale = np.linalg.norm(centers[6] - centers[0]) / np.linalg.norm(
            solution["centers"][6] - solution["centers"][0])
        shift = centers[0] - scale * solution["centers"][0]
        np.testing.assert_allclose(scale * solution["centers"] + shift, centers, atol=1e-5)
        np.testing.assert_array_equal(solution["point_ids"], 10 * np.arange(80) + 3)
        np.testing.assert_allclose(scale * solution["points"] + shift, points, atol=1e-4)
        np.testing.assert_array_equal(solution["component"], 0)
        self.assertLess(solution["gamma_high"], 1e-6)

    def test_bracket(self):
        _, _, arguments = self.scene(1.0)
        solution = rotslam.solve_known_rotation(
            *arguments, options={"bisection": {"relative_gap": 0.01}}, threads=2)
        low, high = solution["gamma_low"], solution["gamma_high"]
        # The truth itself misses by 1 px at most.
        self.assertTrue(0 < low <= high <= 1.01 / 700, (low, high))
        self.assertAlmostEqual(solution["gap"], 1 - low / high, places=12)
        self.assertLessEqual(solution["gap"], 0.0101)

    def test_mathematics_that_says_no_is_no_error(self):
        _, _, (cam_from_world, view, track, pixels, camera) = self.scene(0)
        alone = view == 0
        solution = rotslam.solve_known_rotation(
            cam_from_world, view[alone], track[alone], pixels[alone], camera)
        self.assertEqual(solution["status"], "infeasible")
        self.assertTrue(np.isnan(solution["centers"]).all())
        self.assertEqual(solution["points"].shape, (0, 3))

    def test_wrong_arrays_are_refused(self):
        _, _, (cam_from_world, view, track, pixels, camera) = self.scene(0)

        def refusal(*arguments, **options):
            with self.assertRaises(ValueError) as context:
                rotslam.solve_known_rotation(*arguments, camera, **options)
            return str(context.exception)

        self.assertIn("cam_from_world must be an array of numbers [n, 3, 3], found float64 of "
                      "shape (7, 9)", refusal(cam_from_world.reshape(7, 9), view, track, pixels))
        self.assertIn("cam_from_world[0]: ", refusal(2 * cam_from_world, view, track, pixels))
        self.assertIn("view must be", refusal(cam_from_world, view + 0.5, track, pixels))
        self.assertIn("track has -7", refusal(cam_from_world, view, track - 10, pixels))
        self.assertIn("track must be as long as view", refusal(cam_from_world, view, [1], pixels))
        self.assertIn("keypoints_px must be", refusal(cam_from_world, view, track, pixels[1:]))
        self.assertIn("keypoints_px must be", refusal(cam_from_world, view, track, pixels > 0))
        self.assertIn("keypoints_px[0]", refusal(cam_from_world, view, track, pixels * np.nan))
        self.assertIn("sigma_px must be",
                      refusal(cam_from_world, view, track, pixels, sigma_px=[1]))
        self.assertIn("sigma_rad must be",
                      refusal(cam_from_world, view, track, pixels, sigma_rad=[1]))
        self.assertTrue(refusal(cam_from_world, view + 1, track, pixels))

    def test_adjusts_what_known_rotations_give(self):
        centers, points, arguments = self.scene(0.5)
        cam_from_world, view, track, pixels, camera = arguments
        start = rotslam.solve_known_rotation(*arguments)
        result = rotslam.refine_bundle(cam_from_world, start["centers"], view, track, pixels, camera,
                                       rotation_sigma_rad=np.full(7, 1e-6),
                                       options={"find_covariance": True}, threads=2)
        self.assertTrue(result["is_usable"], result["message"])
        # Orientations that are known this well stay.
        np.testing.assert_allclose(result["cam_from_world"], cam_from_world, atol=1e-5)
        scale = (np.linalg.norm(centers[6] - centers[0])
                 / np.linalg.norm(result["centers"][6] - result["centers"][0]))
        shift = centers[0] - scale * result["centers"][0]
        np.testing.assert_allclose(scale * result["centers"] + shift, centers, atol=0.02)
        self.assertEqual(result["points"].shape, (80, 3))
        self.assertLess(result["median_px"], 0.5)
        self.assertEqual(result["pose_covariance"][6].shape, (6, 6))
        held = rotslam.refine_bundle(cam_from_world, start["centers"], view, track, pixels, camera,
                                     fixed_views={0, 6})
        np.testing.assert_array_equal(held["centers"][[0, 6]], start["centers"][[0, 6]])
        # An eighth view from the place of the seventh.
        again = view == 6
        shared = rotslam.refine_bundle(
            np.concatenate([cam_from_world, cam_from_world[6:]]),
            np.concatenate([start["centers"], start["centers"][6:] + 0.01]),
            np.concatenate([view, np.full(again.sum(), 7)]),
            np.concatenate([track, track[again]]), np.concatenate([pixels, pixels[again]]), camera,
            shared_center={7: 6})
        self.assertTrue(np.isfinite(shared["centers"]).all())
        np.testing.assert_array_equal(shared["centers"][7], shared["centers"][6])
        with self.assertRaisesRegex(ValueError, "nearest one is"):
            rotslam.refine_bundle(*arguments[:1], start["centers"], *arguments[1:],
                                  options={"min_angle_degree": 1.0})


def turn(x, y, z):
    """The rotation matrix of a rotation vector."""
    angle = np.sqrt(x * x + y * y + z * z)
    if angle == 0:
        return np.eye(3)
    a, b, c = x / angle, y / angle, z / angle
    skew = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def quaternion(matrix):
    """x y z w of a rotation by less than half a turn."""
    w = np.sqrt(1 + np.trace(matrix)) / 2
    skew = matrix - matrix.T
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0], 4 * w * w]) / (4 * w)


class Rotations(unittest.TestCase):
    def test_averages_and_certifies(self):
        truth = np.array([turn(0.1 * k, 0.05 * k * k, -0.2 * k) for k in range(8)])
        i, j = np.array([(a, b) for a in range(8) for b in range(a)]).T
        j_from_i = truth[j] @ truth[i].transpose(0, 2, 1)
        j_from_i[3] = turn(1, 0, 0) @ j_from_i[3]
        result = rotslam.average_rotations(i, j, j_from_i, sigma_rad=0.01)
        found = result["cam_from_world"]
        relative = found @ found[0].T @ truth[0]
        np.testing.assert_allclose(relative, truth, atol=1e-5)
        self.assertEqual(result["num_inliers"], len(i) - 1)
        self.assertGreater(result["sigmas"][3], 50)
        np.testing.assert_array_equal(result["component"], 0)
        self.assertGreaterEqual(result["support"].min(), 6)
        self.assertEqual(result["covariance"].shape, (8, 3, 3))
        # Seven edges of 0.01 rad to views that are as uncertain.
        deviations = np.sqrt(np.einsum("kii->ki", result["covariance"]))
        self.assertTrue(np.all((deviations > 0.002) & (deviations < 0.006)), deviations)
        chain = rotslam.average_rotations(np.r_[i, 7], np.r_[j, 8],
                                          np.concatenate([j_from_i, [np.eye(3)]]), sigma_rad=0.01)
        self.assertEqual(chain["support"][8], 1)
        self.assertGreater(chain["covariance"][8, 0, 0], 0.7e-4)
        certificate = rotslam.certify_rotations(i, j, j_from_i, 1.0 * (result["sigmas"] < 6), found)
        self.assertLess(certificate["cost"], 1e-9)
        again = rotslam.average_rotations(i, j, j_from_i, start=truth,
                                          covariance=np.tile(1e-4 * np.eye(3), (len(i), 1, 1)))
        np.testing.assert_allclose(again["cam_from_world"], truth, atol=1e-5)
        for wrong in ({"sigma_rad": 0}, {"options": {"loss_sigma": 3.0}}, {"threads": 0}):
            with self.assertRaises(ValueError):
                rotslam.average_rotations(i, j, j_from_i, **wrong)

    def test_aligns_a_sensor(self):
        times = np.arange(120) / 30
        at = lambda s: turn(0.3 * np.sin(1.3 * s), 0.2 * np.sin(2.1 * s), 0.1 * np.sin(3 * s))
        mounting = turn(0.01, -0.02, 0.03)
        given = np.array([[s + 0.05, *quaternion(at(s).T @ mounting)]
                          for s in np.arange(0, 4, 0.01)])
        result = rotslam.fuse_orientations(times, [at(s) for s in times], np.full(119, 1e-5), given,
                                           options={"use_alignment": True})
        self.assertAlmostEqual(result["offset_s"], 0.05, places=3)
        np.testing.assert_allclose(result["cam_from_sensor"], mounting, atol=1e-3)
        self.assertEqual(set(result["source"]), {"both"})
        self.assertIsNone(rotslam.fuse_orientations(times, [at(s) for s in times],
                                                    np.full(119, 1e-5), given + [100, 0, 0, 0, 0]))


class Readers(unittest.TestCase):
    def test_files(self):
        with tempfile.TemporaryDirectory() as folder:
            graph = Path(folder) / "graph.txt"
            graph.write_text("a b 0 0 0 1\nb c 0 0 0.6 0.8 2.0\n")
            read = rotslam.read_relative_rotations(graph)
            self.assertEqual(read["ids"], ["a", "b", "c"])
            np.testing.assert_allclose(read["covariance"][1], np.radians(2) ** 2 * np.eye(3))
            averaged = rotslam.average_rotations(read["i"], read["j"], read["j_from_i"],
                                                 covariance=read["covariance"])
            self.assertEqual(averaged["cam_from_world"].shape, (3, 3, 3))
            poses = Path(folder) / "poses.txt"
            poses.write_text("1 2 3 4 0 0 0 1\n2 2 3 4 0 0 0.6 0.8\n")
            np.testing.assert_allclose(rotslam.read_trajectory(poses)[1], [2, 2, 3, 4, 0, 0, .6, .8])
            np.testing.assert_allclose(rotslam.read_orientations(poses)[1], [2, 0, 0, .6, .8])
            problem = Path(folder) / "problem.txt"
            problem.write_text("rotslam_known_rotation 1\ncamera pinhole 640 480 500 500 320 240 "
                               "0 0 0 0 0\nviews 2\n7 0 0 0 0 1 0\n9 1 0 0 0 1 0\ntracks 1\n"
                               "5 9 9 9 2 7 10 20 1 9 30 40 1\n")
            read = rotslam.read_known_rotation(problem)
            self.assertEqual(read["names"], ["7", "9"])
            np.testing.assert_array_equal(read["view"], [0, 1])
            np.testing.assert_allclose(read["keypoints_px"], [[10, 20], [30, 40]])
            self.assertEqual(read["camera"].fx, 500)
            with self.assertRaisesRegex(RuntimeError, "nowhere"):
                rotslam.read_trajectory(Path(folder) / "nowhere")

    def test_colmap_models(self):
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder)
            (model / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320.5 240.5\n"
                                               "9 SIMPLE_RADIAL 800 600 700 400.5 300.5 -0.05\n")
            (model / "images.txt").write_text("3 1 0 0 0 0 0 0 9 a.png\n10.5 20.5 -1 100.5 200.5 "
                                              "9000000000\n8 1 0 0 0 -1 0 2 1 b.png\n"
                                              "300.5 100.5 9000000000\n")
            (model / "points3D.txt").write_text("9000000000 1 2 3 10 20 30 0.5 3 1 8 0\n")
            read = rotslam.read_colmap_model(model)
            self.assertEqual(read["names"], ["a.png", "b.png"])
            np.testing.assert_array_equal(read["image_ids"], [3, 8])
            np.testing.assert_array_equal(read["camera_ids"], [9, 1])
            self.assertEqual(set(read["cameras"]), {1, 9})
            self.assertEqual(read["cameras"][1].model, "pinhole")
            self.assertEqual(read["cameras"][9].distortion[0], -0.05)
            self.assertEqual((read["camera"].fx, read["camera"].distortion), (700, [0] * 5))
            np.testing.assert_array_equal(read["cam_from_world"], [np.eye(3)] * 2)
            np.testing.assert_array_equal(read["centers"], [[0, 0, 0], [1, 0, -2]])
            np.testing.assert_array_equal(read["image_keypoints_px"][0],
                                          [[10.5, 20.5], [100.5, 200.5]])
            np.testing.assert_array_equal(read["point_ids"], [9000000000])
            np.testing.assert_array_equal(read["points"], [[1, 2, 3]])
            np.testing.assert_array_equal(read["colours"], [[10, 20, 30]])
            np.testing.assert_array_equal(read["view"], [0, 1])
            np.testing.assert_array_equal(read["track"], [0, 0])
            np.testing.assert_array_equal(read["keypoint"], [1, 0])
            # Of a pinhole with 500 px, in one with 700.
            np.testing.assert_allclose(read["keypoints_px"][1],
                                       1.4 * (np.array([300, 100]) - [320, 240])
                                       + [read["camera"].cx, read["camera"].cy])
            np.testing.assert_allclose(read["sigma_px"][1], 1.4)
            self.assertEqual(read["num_doubled"], 0)
            (model / "points3D.txt").write_text("9000000000 1 2 3 10 20 30 0.5 3 1 4 0\n")
            with self.assertRaisesRegex(RuntimeError, "names image 4"):
                rotslam.read_colmap_model(model)

    def test_the_map_of_a_run(self):
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            run_program("simulate", "handheld", "--frames=24", "--width=320", "--height=240",
                        "--quiet", "--out", folder / "sequence")
            (folder / "options.yaml").write_text("ba: {find_covariance: true}\n")
            run_program("run", folder / "sequence", "--config", folder / "options.yaml", "--quiet",
                        "--out", folder / "run")
            read = rotslam.read_run_map(folder / "run")
            summary = json.loads((folder / "run/summary.json").read_text())
            num_frames, num_tracks = len(read["frames"]), len(read["track_ids"])
            self.assertEqual(num_frames, 24)
            self.assertEqual(int(read["is_keyframe"].sum()), summary["counts"]["keyframes"])
            self.assertEqual(len(read["names"]), 24)
            self.assertEqual(read["camera"].width, 320)
            poses = rotslam.read_trajectory(folder / "run/trajectory_tum.txt")
            np.testing.assert_allclose(read["timestamps"], poses[:, 0], atol=1e-6)
            np.testing.assert_allclose(read["centers"], poses[:, 1:4], atol=1e-6)
            np.testing.assert_allclose(
                [quaternion(R.T) * np.sign(q[3]) for R, q in zip(read["cam_from_world"], poses[:, 4:])],
                poses[:, 4:], atol=1e-6)
            self.assertEqual(read["points"].shape, (num_tracks, 3))
            self.assertEqual((read["colours"].shape, read["colours"].dtype),
                             ((num_tracks, 3), np.uint8))
            # A point lies where the observations that fit it are.
            view, track = (read[name][read["fits"]] for name in ("view", "track"))
            rays = read["points"][track] - read["centers"][view]
            in_camera = np.einsum("kij,kj->ki", read["cam_from_world"][view], rays)
            self.assertTrue((in_camera[:, 2] > 0).all())
            camera = read["camera"]
            self.assertEqual(camera.model, "pinhole")
            pixels = (in_camera[:, :2] / in_camera[:, 2:] * [camera.fx, camera.fy]
                      + [camera.cx, camera.cy])
            misses = np.linalg.norm(pixels - read["keypoints_px"][read["fits"]], axis=1)
            self.assertLess(np.median(misses), 0.5)
            covariance = read["pose_covariance"]
            known = np.isfinite(covariance).all(axis=(1, 2))
            table = np.loadtxt(folder / "run/pose_covariance.csv", delimiter=",", skiprows=1)
            np.testing.assert_array_equal(read["frames"][known], table[:, 0])
            np.testing.assert_array_equal(covariance[known][:, 0, 0], table[:, 2])
            np.testing.assert_array_equal(covariance, covariance.transpose(0, 2, 1))
            edges = read["edges"]
            self.assertEqual(len(edges["i"]), len(edges["num_inliers"]))
            self.assertLess(edges["j"].max(), num_frames)
            # As refine_bundle takes it.
            fits = read["fits"]
            adjusted = rotslam.refine_bundle(
                read["cam_from_world"], read["centers"], view, track, read["keypoints_px"][fits],
                read["camera"], sigma_px=read["sigma_px"][fits])
            self.assertTrue(adjusted["is_usable"], adjusted["message"])
            (folder / "alone").mkdir()
            (folder / "run/map.bin").rename(folder / "alone/map.bin")
            alone = rotslam.read_run_map(folder / "alone/map.bin")
            self.assertIsNone(alone["pose_covariance"])
            np.testing.assert_array_equal(alone["points"], read["points"])
            with self.assertRaisesRegex(RuntimeError, "map.bin"):
                rotslam.read_run_map(folder / "run")

    def test_stubs_name_what_there_is(self):
        stubs = ast.parse(Path(rotslam.__file__).with_name("rotslam.pyi").read_text())
        for node in stubs.body:
            if isinstance(node, ast.ClassDef):
                members = {entry.name for entry in node.body if isinstance(entry, ast.FunctionDef)}
                self.assertLessEqual(members, set(dir(getattr(rotslam, node.name))), node.name)
            if isinstance(node, ast.FunctionDef):
                # pybind11's docstrings begin with the signature.
                signature = getattr(rotslam, node.name).__doc__.split("\n")[0]
                for argument in node.args.args:
                    self.assertIn(argument.arg + ":", signature, node.name)
        named = {node.name for node in stubs.body if hasattr(node, "name")}
        self.assertEqual({name for name in dir(rotslam) if not name.startswith("_")}, named)


if __name__ == "__main__":
    unittest.main()
