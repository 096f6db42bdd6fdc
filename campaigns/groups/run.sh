#!/usr/bin/env bash
# The synthetic cohort by `groups`, and what the tests of coverage print beside what they assert.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin groups
run_in cohort "$program" groups data/cohort --heavy-tails --out "$raw/cohort" --json "$raw/cohort.json" --quiet
run_in coverage cargo test --release --quiet --locked --lib groups::coverage -- --nocapture --test-threads 1
finish
