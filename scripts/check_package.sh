#!/usr/bin/env bash
# Tries an installed rotslam as its users would; each part ends with a line that says so.
#   scripts/check_package.sh [program] [python] [library]    default: all three
# program: renders a sequence, solves it, compares with the truth; python: imports the module and runs it; library: builds
# tests/install/consumer with find_package(rotslam), which takes CMake, a compiler and the recommended packages.
set -euo pipefail
cd "$(dirname "$0")/.."

parts=("$@")
if [[ $# -eq 0 ]]; then parts=(program python library); fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
version=$(sed -n 's/^project(rotslam VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)

fail() {
  echo "${0##*/}: $*" >&2
  exit 1
}

render() {
  [[ -e $work/sequence/camera.yaml ]] || rotslam simulate handheld --frames 60 --out "$work/sequence" --quiet
}

check_program() {
  [[ $(rotslam --version) == *"$version"* ]] || fail "rotslam --version does not say $version"
  prefix=$(dirname "$(dirname "$(command -v rotslam)")")
  for file in bash-completion/completions/rotslam rotslam/config/demo.yaml rotslam/config/cameras/7scenes.yaml; do
    [[ -s $prefix/share/$file ]] || fail "$prefix/share/$file is missing"
  done
  render
  rotslam run "$work/sequence" --config "$prefix/share/rotslam/config/demo.yaml" --out "$work/result" --quiet
  poses=$(grep -c '^[^#]' "$work/result/trajectory_tum.txt")
  [[ $poses -eq 60 ]] || fail "the trajectory has $poses poses instead of 60"
  for file in cloud.ply report.html summary.json; do
    [[ -s $work/result/$file ]] || fail "$file is missing"
  done
  rotslam eval "$work/sequence/groundtruth_tum.txt" "$work/result/trajectory_tum.txt" --images 60
}

check_python() {
  render
  python3 - "$version" "$work/sequence" <<'PYTHON'
import sys
import rotslam

assert rotslam.__version__ == sys.argv[1], rotslam.__version__
result = rotslam.run(sys.argv[2], rotslam.read_camera(sys.argv[2] + "/camera.yaml"))
assert result is not None
PYTHON
}

check_library() {
  render
  cmake -S tests/install/consumer -B "$work/consumer" -D CMAKE_BUILD_TYPE=Release -D expected_version="$version" >"$work/log" ||
    fail "$(cat "$work/log")"
  cmake --build "$work/consumer" >"$work/log" || fail "$(cat "$work/log")"
  "$work/consumer/consumer" "$work/trajectory.txt"
  [[ -s $work/trajectory.txt ]] || fail "the consumer has written nothing"
}

for part in "${parts[@]}"; do
  case $part in
    program | python | library) ;;
    *)
      echo "usage: ${0##*/} [program] [python] [library]" >&2
      exit 2
      ;;
  esac
  "check_$part"
  echo "passed: $part"
done
