#!/usr/bin/env bash
# Builds and tests rotslam on another Debian as a new user would: in a bare debootstrap, from `git archive HEAD`, with
# nothing installed but what our scripts install. Prints one line a step: suite, step, result, minutes, versions.
#   scripts/portability.sh SUITE [STEP...]    SUITE: bookworm, trixie, testing, ...; default: demo test deb
#     demo    scripts/demo.sh
#     test    scripts/test.sh, without the real sequences of ../shared
#     deb     scripts/package.sh, lintian; installs the package on a second bare system, tries the program, the Python
#             module and find_package(rotslam), removes it and looks for what is left
#     pip     `pip install .` in a virtual environment, without a package index
#     clang   libraries and program with the suite's newest Clang
# Needs root, debootstrap and apt's network. Works in build/portability/SUITE (ROTSLAM_PORTABILITY_DIR names another
# folder), where the log of each step stays. ROTSLAM_PORTABILITY_CCACHE names a folder for a compiler cache, which makes a
# second run quicker and its times smaller; ROTSLAM_MIRROR another mirror. Warnings are counted; they fail no step.
# shellcheck disable=SC2317  # the steps are called by name
set -uo pipefail
cd "$(dirname "$0")/.." || exit

if [[ $# -eq 0 || $1 == -* ]]; then
  sed -n '2,/^# shellcheck/{/^# shellcheck/d;s/^# \{0,1\}//;p}' "$0" >&2
  exit 2
fi
suite=$1
shift
steps=("$@")
if [[ ${#steps[@]} -eq 0 ]]; then steps=(demo test deb); fi
for step in "${steps[@]}"; do
  if [[ ! $step =~ ^(demo|test|deb|pip|clang)$ ]]; then
    echo "${0##*/}: no step \"$step\"; there are demo, test, deb, pip and clang" >&2
    exit 2
  fi
done
if [[ $(id -u) -ne 0 ]] || ! command -v debootstrap >/dev/null; then
  echo "${0##*/}: needs root and debootstrap (apt-get install debootstrap)" >&2
  exit 1
fi

mirror=${ROTSLAM_MIRROR:-http://deb.debian.org/debian}
work=$(realpath -m "${ROTSLAM_PORTABILITY_DIR:-build/portability}")/$suite
cache=${ROTSLAM_PORTABILITY_CCACHE:-}
mkdir -p "$work"

# Nothing is mounted below these folders but while `inside` runs, in a mount namespace of its own.
remove() {
  rm -rf --one-file-system "$@"
}

# Runs a command in the folder of the sources of a system, with only what a shell of a new user has.
inside() {  # <system> <command>
  # shellcheck disable=SC2016
  unshare --mount --pid --fork --kill-child bash -c '
    set -e
    mount --make-rprivate /
    mount -t proc proc "$1/proc"
    mount --rbind /dev "$1/dev"
    path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    cached=()
    if [[ -n $3 ]]; then
      mkdir -p "$1/ccache"
      mount --bind "$3" "$1/ccache"
      cached=(CCACHE_DIR=/ccache)
    fi
    exec chroot "$1" env -i PATH="$path" HOME=/root LANG=C.UTF-8 "${cached[@]}" bash -c "cd /rotslam && $2"
  ' _ "$1" "$2" "$cache"
}

bare_system() {  # <system>
  remove "$1"
  cp -a "$work/bare" "$1"
  cp /etc/resolv.conf "$1/etc/resolv.conf"
  # The system is thrown away: it need not survive a power cut, and a mirror may lag behind.
  echo force-unsafe-io >"$1/etc/dpkg/dpkg.cfg.d/portability"
  echo 'Acquire::Check-Valid-Until "false";' >"$1/etc/apt/apt.conf.d/99portability"
  mkdir "$1/rotslam"
  tar -xf "$work/source.tar" -C "$1/rotslam"
}

# Files of the package that are still on the second system, and its own folders.
package_leftovers() {
  local file
  while read -r file; do
    if [[ -f $work/user$file || ($file == */rotslam && -e $work/user$file) ]]; then echo "left: $file"; fi
  done <"$work/files.txt"
}

step_demo() {
  inside "$work/system" "scripts/demo.sh"
}

step_test() {
  inside "$work/system" "scripts/test.sh"
}

step_clang() {
  inside "$work/system" "scripts/install_packages.sh &&
    apt-get install -qq -y --no-install-recommends clang >/dev/null && clang++ --version | head -n 1 &&
    cmake --preset release -B build/clang -D CMAKE_C_COMPILER=clang -D CMAKE_CXX_COMPILER=clang++ -D ROTSLAM_BUILD_TESTS=OFF >/dev/null &&
    cmake --build build/clang"
}

step_pip() {
  inside "$work/system" "scripts/install_packages.sh &&
    apt-get install -qq -y --no-install-recommends python3-venv >/dev/null &&
    python3 -m venv --system-site-packages /venv && /venv/bin/pip install --no-index . &&
    cd / && /venv/bin/python -c 'import rotslam; print(rotslam.__version__, rotslam.__file__)'"
}

step_deb() {
  # lintian is not part of what a user installs.
  inside "$work/system" "apt-get update -qq && apt-get install -qq -y --no-install-recommends lintian >/dev/null &&
    scripts/package.sh" || return
  bare_system "$work/user"
  cp "$work"/system/rotslam/build/package/rotslam_*.deb "$work/user/" || return
  dpkg-deb --contents "$work"/user/rotslam_*.deb | awk '{print substr($6, 2)}' | sed 's:/$::' >"$work/files.txt"
  dpkg-deb --field "$work"/user/rotslam_*.deb
  inside "$work/user" "apt-get update -qq && apt-get install -qq -y --no-install-recommends /rotslam_*.deb >/dev/null &&
    scripts/check_package.sh program python &&
    apt-get install -qq -y cmake g++ \$(dpkg-query -W -f '\${Recommends}' rotslam | tr -d ',') >/dev/null &&
    scripts/check_package.sh library && apt-get purge -qq -y rotslam >/dev/null" || return
  package_leftovers | tee "$work/left.txt"
  [[ ! -s $work/left.txt ]]
}

versions() {
  inside "$work/system" "
    printf 'g++ %s, CMake %s' \"\$(g++ -dumpfullversion)\" \"\$(cmake --version | sed -n '1s/.* //p')\"
    for package in Eigen=libeigen3-dev OpenCV=libopencv-dev Ceres=libceres-dev PCL=libpcl-dev Python=python3; do
      version=\$(dpkg-query -W -f '\${Version}' \${package#*=} 2>/dev/null) || continue
      printf ', %s %s' \${package%%=*} \$(printf %s \$version | sed 's/[-+~].*//')
    done" 2>/dev/null
}

# A suite that this debootstrap does not know yet is made like the one that comes before it.
script=/usr/share/debootstrap/scripts/$suite
if [[ ! -e $script ]]; then script=/usr/share/debootstrap/scripts/sid; fi
remove "$work/bare" "$work/system" "$work/user"
if ! debootstrap --variant=minbase "$suite" "$work/bare" "$mirror" "$script" >"$work/debootstrap.log" 2>&1; then
  tail -n 5 "$work/debootstrap.log" >&2
  echo "${0##*/}: no bare system: see $work/debootstrap.log" >&2
  exit 1
fi
git archive --output "$work/source.tar" HEAD || exit
if [[ -n $cache ]]; then mkdir -p "$cache"; fi
bare_system "$work/system"
if [[ -n $cache ]]; then
  inside "$work/system" "apt-get update -qq && apt-get install -qq -y --no-install-recommends ccache" >"$work/ccache.log" 2>&1
fi

failed=0
for step in "${steps[@]}"; do
  start=$(date +%s)
  result=passed
  if ! "step_$step" >"$work/$step.log" 2>&1; then
    result="FAILED (see $work/$step.log)"
    failed=1
  fi
  warnings=$(grep -c 'warning: .*\[-W\|^CMake .*Warning' "$work/$step.log")
  detail=$(grep -E '[0-9]+ tests failed out of [0-9]+' "$work/$step.log" | tail -n 1)
  echo "$suite $step: $result, $((($(date +%s) - start + 30) / 60)) min${cache:+ with a compiler cache}, $warnings warnings${detail:+, $detail}; $(versions)"
done
remove "$work/bare" "$work/system" "$work/user"
exit "$failed"
