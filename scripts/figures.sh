#!/usr/bin/env bash
# Makes the pictures of docs/images anew: renders sequences, solves them, draws them with `rotslam plot`, and photographs
# three reports with chromium where that is installed. With a folder that holds kitti00, 7scenes_kitchen and
# euroc_v101_keyframes (default: ../shared/data) it makes the pictures of these, too. Keeps what it has rendered and
# solved in runs/figures; a few minutes on two cores after scripts/demo.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

rotslam=${ROTSLAM:-build/release/apps/rotslam}
data=${1:-../shared/data}
work=runs/figures
images=docs/images
mkdir -p "$work" "$images"

solve() {  # <name> <sequence> <options...>: a run, unless one that is newer than the program is there
  local name=$1 sequence=$2
  shift 2
  if [[ ! $work/$name/summary.json -nt $rotslam ]]; then
    "$rotslam" run "$sequence" --out "$work/$name" --quiet "$@"
  fi
  "$rotslam" plot "$work/$name" --out "$work/$name/plots" --dpi 72 --quiet
}

simulate() {  # <name> <kind> <options...>
  local name=$1 kind=$2
  shift 2
  if [[ ! -e $work/sequences/$name/groundtruth_tum.txt ]]; then
    "$rotslam" simulate "$kind" --out "$work/sequences/$name" --quiet "$@"
  fi
  solve "$name" "$work/sequences/$name" --camera "$work/sequences/$name/camera.yaml"
}

keep() {  # <run> <figure> <picture>
  cp "$work/$1/plots/$2.${3##*.}" "$images/$3"
}

photograph() {  # <run> <picture>: the top of its report
  if ! command -v chromium >/dev/null; then
    echo "no chromium: $images/$2.jpg is kept as it is"
    return
  fi
  sed "s|$PWD/||g; s|$(realpath -m "$data")/||g" "$work/$1/report.html" >"$work/$2.html"
  chromium --headless --no-sandbox --hide-scrollbars --enable-unsafe-swiftshader --window-size=1360,1300 \
    --virtual-time-budget=20000 --screenshot="$work/$2.png" "file://$PWD/$work/$2.html" >/dev/null 2>&1
  ffmpeg -loglevel error -y -i "$work/$2.png" -vf scale=1000:-2 -q:v 8 "$images/$2.jpg"
}

simulate gimbal gimbal
keep gimbal relative_rotations relative_rotations.svg
keep gimbal averaging averaging.svg
keep gimbal motion pure_rotation.svg
keep gimbal trajectory component_alignment.svg
keep gimbal registration frame_registration.svg
photograph gimbal report_gimbal

simulate street street --color
keep street tracks tracks.svg
keep street keyframes keyframes.svg
keep street known_rotation known_rotation.svg
keep street residuals bundle_adjustment.svg

simulate rolling_shutter handheld --readout 0.02
keep rolling_shutter rolling_shutter rolling_shutter.svg
simulate motion_blur gimbal --blur 8 --shutter 0.02
keep motion_blur motion_blur motion_blur.svg

if [[ -d $data/euroc_v101_keyframes ]]; then
  printf 'relocalisation: {enabled: false}\n' >"$work/uncorrected.yaml"
  solve corrected "$data/euroc_v101_keyframes"
  keep corrected view_graph loop_closure.svg
  solve uncorrected "$data/euroc_v101_keyframes" --config "$work/uncorrected.yaml"
  keep corrected trajectory map_corrected.png
  keep uncorrected trajectory map_uncorrected.png
fi
if [[ -d $data/kitti00 ]]; then
  solve kitti "$data/kitti00"
  photograph kitti report_kitti
fi
if [[ -d $data/7scenes_kitchen ]]; then
  solve kitchen "$data/7scenes_kitchen" --camera config/cameras/7scenes.yaml
  photograph kitchen report_kitchen
fi
