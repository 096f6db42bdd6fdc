#!/usr/bin/env bash
# Small faults put into the library, and whether a test finds each: all go through the tests of their own crates first, then the others through those above, the fast programs first. Faults are drawn by a fixed seed and put into a copy of the commit, with
# its own target directory and caches. One build holds all of them; while a test runs, an environment variable chooses one. Examples in the documentation are no part of it.
# A survivor that changes nothing is given its reason by hand in reasons.json.
# With RESUME=1 mutants that have their outcome are kept. `campaigns/mutants/mutate.py --list` shows the draws.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin mutants none
run_in mutants "$python" "$root/campaigns/mutants/mutate.py" --count "${COUNT:-40}" --seed 1 --out "$raw"
finish
