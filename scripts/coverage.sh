#!/usr/bin/env bash
# Which lines of the libraries their own tests run, end-to-end tests left out: builds the `coverage` preset, passes the
# tests of each library, prints its share and fails below 90 %. Leaves build/coverage/coverage.html. Needs gcovr;
# arguments go to ctest: `scripts/coverage.sh -L fast` leaves out the slow tests.
set -euo pipefail
cd "$(dirname "$0")/.."

libraries=(rotodom krot ba output)
build=build/coverage

if ! command -v gcovr >/dev/null; then
  echo "${0##*/}: needs gcovr (Debian: apt-get install gcovr)" >&2
  exit 1
fi
if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER:-ccache}
fi
cmake --preset coverage >/dev/null
targets=()
for library in "${libraries[@]}"; do targets+=("tests/$library/all"); done
cmake --build --preset coverage --target "${targets[@]}"

# Counts add up over runs: start from none.
find "$build" -name '*.gcda' -delete
for library in "${libraries[@]}"; do
  ctest --test-dir "$build/tests/$library" --output-on-failure --parallel "$(nproc)" "$@"
done

gcovr --root . --object-directory "$build" --filter '(rotodom|krot|ba|output)/' --json "$build/coverage.json" "$build"
gcovr --root . --add-tracefile "$build/coverage.json" --html-details "$build/coverage.html"
status=0
for library in "${libraries[@]}"; do
  echo "== $library"
  gcovr --root . --add-tracefile "$build/coverage.json" --filter "$library/" --fail-under-line 90 --print-summary |
    grep '^lines:' || status=1
done
exit "$status"
