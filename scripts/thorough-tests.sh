#!/usr/bin/env bash
# Runs the tests marked `#[ignore = "thorough"]`. `cargo test` omits them to finish in three minutes, but they must pass before a change lands.
# Tests marked `campaigns/long-tests` take minutes each and run as that campaign.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

names=$(grep -rh --include='*.rs' -A3 'ignore = "thorough"' src tests crates examples | sed -n 's/^ *fn \([a-z0-9_]*\)(.*/\1/p' | sort -u)
count=$(wc -w <<<"$names")
if ((count < 20)); then
    printf 'thorough-tests: only %s tests are marked as thorough; the search for them is broken\n' "$count" >&2
    exit 1
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# shellcheck disable=SC2086 # every name is a word of its own
cargo test --locked -- --ignored $names | tee "$log"
# A name that no binary knows would be skipped silently.
ran=$(grep -c '^test .* \.\.\. ok' "$log")
if ((ran < count)); then
    printf 'thorough-tests: %s tests are marked, and %s were run\n' "$count" "$ran" >&2
    exit 1
fi
