"""Poses from a camera or a video, as they come: live.py SOURCE CAMERA TRAJECTORY.txt"""
import sys
import time

import cv2
import rotslam

source, camera, trajectory = sys.argv[1:]
capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
slam = rotslam.LiveSlam(rotslam.read_camera(camera), keep_images=True)
start = time.monotonic()
try:
    while True:
        is_there, image = capture.read()
        if not is_there:
            break
        pose = slam.add(image, time.monotonic() - start)
        print(pose.state, pose.position, flush=True)
except KeyboardInterrupt:
    pass
result = slam.finish()
print(result)
result.write_trajectory(trajectory)
