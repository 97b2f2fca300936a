#!/usr/bin/env bash
# Lets libFuzzer loose on the parsers, one after the other, and prints what came of it; fails when anything was found.
#   scripts/fuzz.sh SECONDS [TARGET...]   SECONDS for each target; all targets where none is named
# What it has learnt is kept below build/fuzz/found/TARGET, where the next run goes on; inputs that ended the program
# lie beside it, with their log.
set -uo pipefail
cd "$(dirname "$0")/.." || exit

if [[ ! ${1:-} =~ ^[1-9][0-9]*$ ]]; then
  echo "usage: ${0##*/} SECONDS [TARGET...]" >&2
  exit 2
fi
seconds=$1
shift
wanted=" $* "

scripts/install_packages.sh --fuzz || exit
programs=build/fuzz/tests/fuzz
found=build/fuzz/found
if [[ ! -e build/fuzz/build.ninja ]]; then cmake --preset fuzz >/dev/null || exit; fi
cmake --build --preset fuzz || exit

if [[ -d /dev/shm ]]; then export TMPDIR=${TMPDIR:-/dev/shm}; fi
export PATH=$PATH:/usr/lib/llvm-14/bin  # where the sanitizers look for the symbolizer
# See the asan test preset.
export ASAN_OPTIONS=intercept_tls_get_addr=0
export LSAN_OPTIONS=suppressions=$PWD/tests/lsan_suppressions.txt:print_suppressions=0

# Each program lists its targets where none is chosen.
targets() {  # <program>
  "$1" 2>&1 | sed -n 's/^give --target=NAME, of: //p'
}

total=0
num_run=0
printf '%-18s %12s %8s %9s\n' target executions seconds findings
for program in "$programs"/fuzz_*; do
  [[ -x $program && -f $program ]] || continue
  for target in $(targets "$program"); do
    [[ $wanted == "  " || $wanted == *" $target "* ]] || continue
    num_run=$((num_run + 1))
    mkdir -p "$found/$target/corpus"
    log=$found/$target/log.txt
    start=$(date +%s)
    "$program" --target="$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=256 \
      -max_len=4096 -print_funcs=0 -print_final_stats=1 -artifact_prefix="$found/$target/" \
      "$found/$target/corpus" "tests/fuzz/corpus/$target" >"$log" 2>&1
    status=$?
    findings=$((status != 0))
    total=$((total + findings))
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    printf '%-18s %12s %8s %9s\n' "$target" "${executions:--}" $(($(date +%s) - start)) "$findings"
  done
done
if [[ $num_run -eq 0 || ($# -gt 0 && $num_run -ne $#) ]]; then
  echo "${0##*/}: not every target that was named is there" >&2
  exit 2
fi
if [[ $total -gt 0 ]]; then echo "$total findings: see the inputs and logs below $found"; fi
[[ $total -eq 0 ]]
