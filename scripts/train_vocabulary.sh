#!/usr/bin/env bash
# Trains the vocabulary that ships, config/vocabulary/default.rotvoc, from rendered sequences and TUM RGB-D's fr1_rpy.
#   scripts/train_vocabulary.sh FR1_RPY [OUT]    FR1_RPY: the folder of its images (rgb/)
# Renders below runs/vocabulary what is not there yet: four minutes of processor time; training takes half a minute. The
# same images give the same file; ROTSLAM names another program than that of the release build.
set -euo pipefail
if [[ $# -lt 1 || $# -gt 2 || ! -d $1 ]]; then
  echo "usage: ${0##*/} FR1_RPY_RGB_FOLDER [OUT]" >&2
  exit 2
fi
fr1=$(realpath "$1")
out=$(realpath --canonicalize-missing "${2:-$(dirname "$0")/../config/vocabulary/default.rotvoc}")
cd "$(dirname "$0")/.."

rotslam=${ROTSLAM:-build/release/apps/rotslam}
scenes=runs/vocabulary

# Worlds of their own: no test renders these seeds. Every eighth frame of each way.
render() {  # <kind> <seed> <options...>
  local folder=$scenes/$1_$2
  if [[ ! -e $folder/groundtruth_tum.txt ]]; then
    "$rotslam" simulate "$1" --seed "$2" --speed-scale 8 --out "$folder" --quiet "${@:3}"
  fi
}

wide=(--width 1241 --height 376 --hfov-deg 82)
for ((k = 0; k < 15; ++k)); do
  view=(--hfov-deg $((60 + 10 * (k % 4))) --noise $((1 + k % 3)))
  if ((k % 2 == 0)); then
    render street $((7100 + k)) "${wide[@]}"
  else
    render street $((7100 + k)) "${view[@]}"
  fi
done
for ((k = 0; k < 8; ++k)); do
  view=(--hfov-deg $((55 + 10 * (k % 4))) --noise $((1 + k % 3)))
  render handheld $((7200 + k)) --frames 19 "${view[@]}"
  render gimbal $((7300 + k)) "${view[@]}"
done

mapfile -t real < <(find "$fr1" -name '*.jpg' -o -name '*.png' | LC_ALL=C sort | awk 'NR % 5 == 1')
"$rotslam" vocabulary train "$scenes"/{street_71,handheld_72,gimbal_73}??/rgb "${real[@]}" --out "$out"
