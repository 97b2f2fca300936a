#!/usr/bin/env bash
# Installs the Debian packages that rotslam needs and that are missing; the only list of them.
#   scripts/install_packages.sh            what building, running and testing takes
#   scripts/install_packages.sh --ci       and what only continuous integration takes
#   scripts/install_packages.sh --fuzz     and what only scripts/fuzz.sh takes
#   scripts/install_packages.sh --package  and what only scripts/package.sh takes
# Works as root or through sudo; asks the network for nothing when all is there.
set -euo pipefail

packages=(
  # tools
  cmake g++ ninja-build pkg-config
  # rotodom
  libavcodec-dev libavformat-dev libavutil-dev libeigen3-dev libheif-dev libopencv-dev libswscale-dev libtinyxml2-dev
  libyaml-cpp-dev nlohmann-json3-dev
  # ROS bags: their compressed chunks; SQLite is below
  libbz2-dev liblz4-dev libzstd-dev
  # krot and ba
  coinor-libclp-dev libceres-dev libgoogle-glog-dev
  # output and apps
  libcli11-dev libexif-dev libpcl-dev libspdlog-dev libsqlite3-dev
  # Python module; numpy also for the independent check of `rotslam eval`
  pybind11-dev python3-dev python3-numpy
  # the report and the plots; the page of a live session
  libcairo2-dev libjs-three libcpp-httplib-dev
  # the paper's method
  libopengv-dev
  # tests; GLPK to compare with
  libglpk-dev libgmock-dev libgtest-dev
)
# Not needed: libbenchmark-dev, for the benchmarks (ROTSLAM_BUILD_BENCHMARKS).
if [[ ${1:-} == --ci ]]; then
  # colmap: the tests that hand it our models; chromium: the one that opens the report; they skip without
  packages+=(clang-format-14 clang-tidy-14 chromium colmap)
elif [[ ${1:-} == --fuzz ]]; then
  # llvm: its symbolizer, which gives stack traces names
  packages+=(clang-14 libclang-rt-14-dev llvm-14)
elif [[ ${1:-} == --package ]]; then
  packages+=(dpkg-dev file)
elif [[ $# -gt 0 ]]; then
  echo "usage: ${0##*/} [--ci|--fuzz|--package]" >&2
  exit 2
fi

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "${0##*/}: this is not Debian; install what corresponds to: ${packages[*]}" >&2
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then
  exit 0
fi

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "${0##*/}: needs root or sudo to install: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "installing: ${missing[*]}"
log=$(mktemp --tmpdir rotslam_packages.XXXXXX.log)
echo "what apt-get says goes to $log"
status=0
{
  "${as_root[@]}" apt-get update -qq &&
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
      apt-get install -qq -y --no-install-recommends "${missing[@]}"
} >"$log" 2>&1 || status=$?
if [[ $status -ne 0 ]]; then
  tail -n 20 "$log" >&2
  echo "${0##*/}: apt-get failed; all it said is in $log" >&2
  exit "$status"
fi
