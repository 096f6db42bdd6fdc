#!/usr/bin/env bash
# Runs the tests marked `#[ignore = "thorough"]`. `cargo test` omits them to finish in three minutes, but they must pass before a change lands.
# Tests marked `campaigns/long-tests` take minutes each and run as that campaign.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

marked() {
    grep -rhE --include='*.rs' -A3 "ignore = \"$1" src tests crates examples | sed -n 's/^ *fn \([a-z0-9_]*\)(.*/\1/p' | sort -u
}
names=$(marked thorough)
# A name also selects the tests whose names contain it, such as those of a campaign with many more runs.
skipped=$(marked campaigns/ | sed 's/^/--skip /' || true)
count=$(wc -w <<<"$names")
if ((count < 20)); then
    printf 'thorough-tests: only %s tests are marked as thorough; the search for them is broken\n' "$count" >&2
    exit 1
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# shellcheck disable=SC2086 # every name is a word of its own
cargo test --locked -- --ignored $names $skipped | tee "$log"
# A name that no binary knows would be skipped silently.
ran=$(grep -c '^test .* \.\.\. ok' "$log")
if ((ran < count)); then
    printf 'thorough-tests: %s tests are marked, and %s were run\n' "$count" "$ran" >&2
    exit 1
fi
