"""COLMAP's images.txt as a TUM trajectory; the images' names are their timestamps."""

import pathlib
import sys


def rotated(q, v):
    """v turned by the unit quaternion q = (w, x, y, z)."""
    w, x, y, z = q
    a, b, c = v
    t = (2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a))
    return (
        a + w * t[0] + y * t[2] - z * t[1],
        b + w * t[1] + z * t[0] - x * t[2],
        c + w * t[2] + x * t[1] - y * t[0],
    )


def main():
    lines = [line for line in open(sys.argv[1]) if not line.startswith("#")]
    poses = []
    for line in lines[::2]:
        words = line.split()
        w, x, y, z, *translation = map(float, words[1:8])
        inverse = (w, -x, -y, -z)
        center = [-value for value in rotated(inverse, translation)]
        poses.append((float(pathlib.Path(words[9]).stem), *center, -x, -y, -z, w))
    for pose in sorted(poses):
        print(" ".join(f"{value:.9f}" for value in pose))


main()
