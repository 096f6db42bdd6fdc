#!/usr/bin/env bash
# Small faults put into the library one at a time, and whether a test finds each: unit tests of the faulty crate first, then those of the crates above it, then all tests. Faults are drawn by a
# fixed seed and put into a copy of the commit, with its own target directory and caches. A survivor that changes nothing is given its reason by hand in reasons.json.
# The tests run once without a fault first; PASSED=1 leaves that out where they passed on this commit already.
# STAGES=1 runs the unit tests of the faulty crate only; a survivor of these may still be found by the other tests.
# With RESUME=1 mutants that have their outcome are kept. `campaigns/mutants/mutate.py --list` shows the draws.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin mutants none
run_in mutants "$python" "$root/campaigns/mutants/mutate.py" --count "${COUNT:-40}" --seed 1 --stages "${STAGES:-3}" ${PASSED:+--passed} --out "$raw"
finish
