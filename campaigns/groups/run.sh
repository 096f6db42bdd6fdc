#!/usr/bin/env bash
# The synthetic cohort by `groups`: ratios of species, whose truth stands in data/cohort. How often such intervals hold is asserted by crates/cohorts/src/coverage_tests.rs.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin groups
run_in cohort "$program" groups data/cohort --heavy-tails --out "$raw/cohort" --json "$raw/cohort.json" --quiet
rm -rf "$raw/cohort"
finish
