#!/usr/bin/env bash
# Mutated files to every reader: counts panics, hangs and refusals. 100,000 inputs take about an hour and a half of one core.
#   campaigns/hard-input/run.sh [COUNT] [SECONDS]
# Input number k is the same for the same seed, whatever COUNT. Writes result.json beside this script.
set -euo pipefail
cd "$(dirname "$0")/../.."
count=${1:-100000}
seconds=${2:-1000000}
seed=20
cargo build --release --quiet --example hard_input --bin vitreo-uq
result=$(mktemp)
trap 'rm -f "$result"' EXIT
status=0
"${HARD_INPUT_PROGRAM:-target/release/examples/hard_input}" "$count" "$seed" "$seconds" \
  "${VITREO_UQ_PROGRAM:-target/release/vitreo-uq}" > "$result" || status=$?
commit=$(git rev-parse HEAD)$(git diff --quiet HEAD || echo ", changed")
processor=$(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1)
python3 - "$result" "$commit" "${processor:-unknown}" > campaigns/hard-input/result.json <<'PYTHON'
import json, sys
document = json.load(open(sys.argv[1]))
document["commit"], document["processor"] = sys.argv[2:]
print(json.dumps(document, indent=2, ensure_ascii=False))
PYTHON
exit "$status"
