"""From a folder of images to a map: run.py IMAGES CAMERA CLOUD.ply TRAJECTORY.txt"""
import sys

import rotslam


def show(stage, step, num_steps):
    if step % 50 == 0:
        print(f"{stage} {step}/{num_steps}" if num_steps > 0 else stage, flush=True)


images, camera, cloud, trajectory = sys.argv[1:]
result = rotslam.run(images, rotslam.read_camera(camera), progress=show, threads=2)
print(result)
result.write_ply(cloud)
result.write_trajectory(trajectory)
