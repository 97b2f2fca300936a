#!/usr/bin/env bash
# A camera walks, stops, turns to an entirely new view and walks on. COLMAP alone gets stuck at the turn; started from
# our poses and matches it has all of them. Needs colmap (no GPU, no display) and python3.
#   warm_start.sh ROTSLAM FOLDER      the built program, and where to write
set -euo pipefail
if [[ $# -ne 2 ]]; then
  echo "usage: ${0##*/} ROTSLAM FOLDER" >&2
  exit 2
fi
rotslam=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
mkdir -p "$2"
cd "$2"
export QT_QPA_PLATFORM=offscreen

colmap_to_tum() {  # <model folder> <trajectory file>
  mkdir -p text
  colmap model_converter --input_path "$1" --output_path text --output_type TXT >>colmap.log
  python3 "$here/colmap_to_tum.py" text/images.txt >"$2"
}

report() {  # <name> <model folder>
  colmap model_analyzer --path "$2" | grep -E '^(Registered images|Points|Mean reprojection)' | sed "s|^|$1: |"
  colmap_to_tum "$2" "$1.txt"
  "$rotslam" eval sequence/groundtruth_tum.txt "$1.txt" --images "$num_images" | grep -E '^(coverage|RPE_1|RPE_n|ATE)' |
    sed "s|^|$1: |"
}

"$rotslam" simulate gimbal --frames 60 --quiet --out sequence
num_images=$(grep -c '^[^#]' sequence/groundtruth_tum.txt)
camera=$(awk '/^fx/ { fx = $2 } /^fy/ { fy = $2 } /^cx/ { cx = $2 + 0.5 } /^cy/ { cy = $2 + 0.5 }
  END { printf "%.9f,%.9f,%.9f,%.9f", fx, fy, cx, cy }' sequence/camera.yaml)

# COLMAP alone, with the true camera.
rm -rf alone alone.db
mkdir alone
time {
  colmap feature_extractor --database_path alone.db --image_path sequence/rgb --ImageReader.single_camera 1 \
    --ImageReader.camera_model PINHOLE --ImageReader.camera_params "$camera" --SiftExtraction.use_gpu 0 \
    --SiftExtraction.max_num_features 1000
  colmap sequential_matcher --database_path alone.db --SiftMatching.use_gpu 0
  colmap mapper --database_path alone.db --image_path sequence/rgb --output_path alone \
    --Mapper.ba_refine_focal_length 0 --Mapper.ba_refine_extra_params 0
} >colmap.log
for model in alone/*; do report "alone_${model##*/}" "$model"; done

# The same from our poses and matches.
rm -rf triangulated adjusted
mkdir triangulated adjusted
time {
  "$rotslam" run sequence --camera sequence/camera.yaml --out run --quiet
  "$rotslam" export run --all-frames --to colmap --out model --quiet
  "$rotslam" export run --all-frames --to colmap-db --out warm.db --quiet
  colmap point_triangulator --database_path warm.db --image_path sequence/rgb --input_path model \
    --output_path triangulated
  colmap bundle_adjuster --input_path triangulated --output_path adjusted \
    --BundleAdjustment.refine_focal_length 0 --BundleAdjustment.refine_extra_params 0
} >>colmap.log
report ours model
report warm adjusted
