#!/usr/bin/env bash
# Whole-process CPU time and peak memory of `zmend repair`, as Markdown rows: the tables of docs/benchmarks.md.
#   benches/whole.sh                    built-in samples at depths 8 to 11
#   benches/whole.sh FILE DEPTH...      a file of yours
# Each row is the least of three runs, the output written to a fresh file. Needs bash and a built program.
set -euo pipefail
cd "$(dirname "$0")/.."
zmend=${ZMEND:-target/release/zmend}
[ -x "$zmend" ] || cargo build --release
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
TIMEFORMAT='%U %S %R'

field() { sed -n "s/.*\"$1\":\([0-9]*\).*/\1/p" "$2" | head -n 1; }

row() { # name, file, depth, options...
    local name=$1 file=$2 depth=$3; shift 3
    local best=""
    for _ in 1 2 3; do
        rm -f "$work/out.ply"
        local t
        t=$({ time "$zmend" repair "$file" "$work/out.ply" --depth "$depth" --inside parity "$@" --report brief --json >"$work/json" 2>/dev/null; } 2>&1)
        best=$(printf '%s\n%s\n' "$best" "$t" | awk 'NF==3 && (!n || $1+$2<n) {n=$1+$2; b=$0} END {print b}')
    done
    awk -v name="$name" -v depth="$depth" -v how="$*" -v t="$best" -v cells="$(field crossings "$work/json")" \
        -v bytes="$(field peak_memory_bytes "$work/json")" -v size="$(stat -c %s "$work/out.ply")" 'BEGIN {
            split(t, s, " "); cpu = s[1] + s[2]
            printf "| %s | %d | %s | %d | %.2f | %.2f | %.0f | %.0f | %.1f | %.0f |\n", name, depth, how, cells, cpu, s[3],
                bytes / 1e6, 1e9 * cpu / cells, bytes / cells, size / 1e6 }'
}

echo '| input | depth | options | surface cells | CPU s | wall s | peak MB | ns a cell | bytes a cell | output MB |'
echo '|---|---|---|---|---|---|---|---|---|---|'
if [ $# -gt 0 ]; then
    file=$1; shift
    for depth in "$@"; do
        row "$(basename "$file")" "$file" "$depth" --surface mc
        row "$(basename "$file")" "$file" "$depth" --surface dc --faces polygons
    done
else
    "$zmend" sample knot "$work/knot.ply" --detail 2 >/dev/null
    "$zmend" sample knot-holes "$work/knot-holes.ply" --detail 2 >/dev/null
    for depth in 8 9 10 11; do
        row 'knot' "$work/knot.ply" "$depth" --surface mc
        row 'knot-holes' "$work/knot-holes.ply" "$depth" --surface mc
        row 'knot' "$work/knot.ply" "$depth" --surface dc --faces polygons
    done
fi
