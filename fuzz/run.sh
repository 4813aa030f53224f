#!/usr/bin/env bash
# Runs fuzz targets one after another and prints how often each was executed.
#
#   fuzz/run.sh                  all targets, 20 minutes each
#   fuzz/run.sh 5                all targets, 5 minutes each
#   fuzz/run.sh 5 stl soups      these two
#
# Needs a nightly toolchain and `cargo install cargo-fuzz`. What it finds lies in fuzz/artifacts/TARGET; a finding is mended, and its bytes go into
# tests/replay/findings/TARGET, where `cargo test` replays them. What it learns lies in fuzz/corpus/TARGET, and is used the next time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
minutes=${1:-20}
shift || true
seeds=../tests/replay/seeds
if [ $# -eq 0 ]; then
    set -- $(ls "$seeds")
fi
# No unsafe code, so no sanitizer; debug assertions stay, and so do checks of overflow.
cargo +nightly fuzz build --sanitizer none --debug-assertions target
program=$(find "${CARGO_TARGET_DIR:-target}" -path '*/release/target' -type f | head -n 1)
failed=()
printf '%-14s %12s %10s %9s %s\n' target executions a\ second corpus findings
for target in "$@"; do
    mkdir -p "corpus/$target" "artifacts/$target"
    found=$(ls "artifacts/$target" | wc -l)
    # A longer input says nothing new; a slow one counts as a finding, as does one that allocates 512 MB at once.
    ZMEND_FUZZ=$target "$program" "corpus/$target" "$seeds/$target" -max_total_time=$((60 * minutes)) -timeout=20 -malloc_limit_mb=512 \
        -rss_limit_mb=2048 -max_len=4096 -artifact_prefix="artifacts/$target/" -print_final_stats=1 -dict=words.txt \
        >"artifacts/$target.log" 2>&1 || failed+=("$target")
    stat() { sed -n "s/^stat::$1: *//p" "artifacts/$target.log"; }
    printf '%-14s %12s %10s %9s %s\n' "$target" "$(stat number_of_executed_units)" "$(stat average_exec_per_sec)" \
        "$(ls "corpus/$target" | wc -l)" $(($(ls "artifacts/$target" | wc -l) - found))
done
if [ ${#failed[@]} -gt 0 ]; then
    printf 'findings in: %s\n' "${failed[*]}" >&2
    exit 1
fi
