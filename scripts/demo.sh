#!/usr/bin/env bash
# From a fresh Debian 12 to a trajectory and a point cloud: installs what is missing, builds Release, renders the
# built-in sequence (the camera walks, stops, turns to an entirely new view, walks on), solves it and compares with the
# exact truth. A second run skips what is done. Writes below build/release and runs/demo.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_packages.sh

if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER:-ccache}
fi
cmake --preset release >/dev/null
cmake --build --preset release --target rotslam

rotslam=build/release/apps/rotslam
sequence=runs/demo/sequence
result=runs/demo/result
truth=$sequence/groundtruth_tum.txt
summary=$result/summary.json

if [[ $truth -nt $rotslam ]]; then
  echo "kept: $sequence, newer than the program"
else
  "$rotslam" simulate gimbal --out "$sequence"
fi
if [[ $summary -nt $truth ]]; then
  echo "kept: $result, newer than the sequence"
else
  "$rotslam" run "$sequence" --camera "$sequence/camera.yaml" --out "$result"
fi

images=$(grep -c '^[^#]' "$truth")
echo
echo "accuracy against the exact truth:"
"$rotslam" eval "$truth" "$result/trajectory_tum.txt" --images "$images"
echo
echo "written:"
printf '%s\n' "$PWD/$result"/*
echo
echo "to look at it, open in a browser: $PWD/$result/report.html"
echo "what it means: docs/tutorial.md; a video of your own: docs/own_video.md"
