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

cover() {  # <name> <run> <filter>: the frames of a rendered sequence with something on the picture, and what was found
  local name=$1 from=$work/sequences/$2 to=$work/sequences/$1 size
  if [[ ! -e $to/camera.yaml ]]; then
    mkdir -p "$to/images"
    ffmpeg -loglevel error -pattern_type glob -i "$from/rgb/*.png" -vf "$3" -start_number 0 "$to/images/%06d.png"
    cp "$from/camera.yaml" "$to/"
  fi
  solve "$name" "$to/images" --camera "$to/camera.yaml" --fps 30
  size=$(sed -n 's/^width: //p' "$to/camera.yaml")x$(sed -n 's/^height: //p' "$to/camera.yaml")
  ffmpeg -loglevel error -y -i "$to/images/000040.png" -i "$work/$name/mask.png" -f lavfi -i "color=red:s=$size" \
    -filter_complex "[0]format=gbrp,split[a][b];[1]negate,format=gbrp[m];[2]format=gbrp[r];[b][r][m]maskedmerge[c];
      [a][c]hstack,scale=960:-2" -frames:v 1 -update 1 -q:v 6 "$images/footage_$name.jpg"
}

text="drawtext=fontcolor=white:borderw=3:fontsize=28"
cover display street "$text:text='16.2V':x=20:y=20,$text:text='GPS 11':x=20:y=70,$text:text='H 31.8M':x=480:y=20,
  $text:text='D 207M':x=480:y=70,$text:text='HORIZON ARMED':x=190:y=20,$text:text='PWR 100':x=480:y=430,
  $text:text='980MAH':x=20:y=430,drawbox=x=260:y=200:w=40:h=4:color=white:t=fill,drawbox=x=340:y=200:w=40:h=4:color=white:t=fill,
  drawbox=x=260:y=260:w=40:h=4:color=white:t=fill,drawbox=x=340:y=260:w=40:h=4:color=white:t=fill"
cover border street "format=gbrp,geq=r='r(X,Y)*lt(hypot(X-W/2,Y-H/2),H*0.46)':g='g(X,Y)*lt(hypot(X-W/2,Y-H/2),H*0.46)':b='b(X,Y)*lt(hypot(X-W/2,Y-H/2),H*0.46)'"

sensor() {  # <sequence>: orientations of a sensor on its camera: 0.05 deg of noise, 40 ms late, mounted 1.7 deg wrong
  awk 'BEGIN { srand(1); rad = atan2(0, -1) / 180 }
    function normal() { return sqrt(-2 * log(1 - rand())) * cos(2 * atan2(0, -1) * rand()) }
    !/^#/ { a = rad / 2 * (0.74 + 0.05 * normal()); b = rad / 2 * (-1.48 + 0.05 * normal()); c = rad / 2 * (0.37 + 0.05 * normal())
      d = sqrt(1 - a * a - b * b - c * c); x = $5; y = $6; z = $7; w = $8
      printf "%.6f 0 0 0 %.9f %.9f %.9f %.9f\n", $1 + 0.04, w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c }' "$1/groundtruth_tum.txt" >"$1/sensor.txt"
}

if [[ ! -e $work/sequences/dark/sensor.txt ]]; then
  "$rotslam" simulate handheld --frames 150 --width 480 --height 360 --out "$work/sequences/dark" --quiet
  mapfile -t pictures < <(ls "$work"/sequences/dark/rgb/*.png | sed -n 71,85p)
  ffmpeg -loglevel error -y -f lavfi -i color=black:s=480x360 -frames:v 1 -update 1 "$work/black.png"
  for picture in "${pictures[@]}"; do cp "$work/black.png" "$picture"; done
  sensor "$work/sequences/dark"
fi
solve dark "$work/sequences/dark" --camera "$work/sequences/dark/camera.yaml" --rotations "$work/sequences/dark/sensor.txt" --align
keep dark sources orientations_from_outside.svg

: >"$work/batch.yaml"
for name in gimbal street dark; do
  printf -- '- {path: sequences/%s, ground_truth: sequences/%s/groundtruth_tum.txt}\n' $name $name >>"$work/batch.yaml"
done
printf -- '- {path: sequences/nowhere}\n' >>"$work/batch.yaml"
"$rotslam" batch "$work/batch.yaml" --jobs 2 --out "$work/batch" --quiet || true
if command -v chromium >/dev/null; then
  sed "s|$PWD/||g" "$work/batch/results.html" >"$work/results.html"
  chromium --headless --no-sandbox --hide-scrollbars --window-size=1360,420 --screenshot="$images/cluster.png" \
    "file://$PWD/$work/results.html" >/dev/null 2>&1
fi

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
