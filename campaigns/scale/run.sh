#!/usr/bin/env bash
# What work on many machines costs: a thousand specimens as tasks, by one worker and by two; the overhead of a task; a hundred thousand results gathered; challenges
# in parts against one machine, byte for byte; and where the direct solver ends against an iterative one, to a million unknowns. `COUNT=100 LEVELS='3 4' ITERATIVE='3 4'` for a look.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin scale
here=$root/campaigns/scale
count=${COUNT:-1000}
measured=("$python" "$here/measure.py")
cd "$raw"

# A thousand records of an instrument, and lists of them, three times by one worker, by two and all in one task: clocks of a shared machine wander.
"$python" "$here/specimens.py" "$count" cohort
run_in "list" "${measured[@]}" "$program" tasks sample cohort --out tasks-1 --quiet
for k in 1 2 3; do
    "$program" tasks sample cohort --out "tasks-1-$k" --quiet >/dev/null
    "$program" tasks sample cohort --out "tasks-2-$k" --quiet >/dev/null
    "$program" tasks sample cohort --out "tasks-block-$k" --block "$count" --quiet >/dev/null
    run_in "one-worker-$k" "${measured[@]}" "$program" tasks run "tasks-1-$k" --jobs 1 --quiet
    run_in "two-workers-$k" "${measured[@]}" "$program" tasks run "tasks-2-$k" --jobs 2 --quiet
    run_in "in-one-task-$k" "${measured[@]}" "$program" tasks run "tasks-block-$k" --jobs 1 --quiet
done
run_in "there-already" "${measured[@]}" --times 20 "$program" tasks run tasks-1-1 --task 7 --quiet
run_in "gather-specimens" "${measured[@]}" "$program" gather tasks-1-1 --quiet

# The synthetic cohort's eyes, whose apparatus is solved for by finite elements and then known.
"$program" tasks sample "$root/data/cohort" --out eyes --quiet >/dev/null
run_in "eyes" "${measured[@]}" "$program" tasks run eyes --jobs 1 --quiet

# Challenges: in parts, and at once.
cases=${CASES:-4}
play=(challenge run --count "$cases" --only single --signal 10 --seed 24)
run_in "challenges" "${measured[@]}" "$program" "${play[@]}" --threads 1 --json one.json --quiet
"$program" tasks challenge --count "$cases" --only single --signal 10 --seed 24 --out challenges --block 2 --quiet >/dev/null
run_in "challenge-tasks" "${measured[@]}" "$program" tasks run challenges --jobs 1 --quiet
"$program" gather challenges --quiet >/dev/null
cmp one.json challenges/gathered/challenge.json && printf '{"same": true}\n' >same.txt

# A hundred thousand results.
results=${RESULTS:-100000}
"$root/target/release/examples/many_results" many "$results" one.json
run_in "gather-many" "${measured[@]}" "$program" gather many --quiet

# The direct solver, then the iterative one: one mesh a process.
for level in ${LEVELS:-3 4 5 6 7 8}; do
    run_in "level-$level" "$root/target/release/examples/factorisations" "$level"
done
for level in ${ITERATIVE:-3 4 6 8 10 12}; do
    run_in "iterative-$level" "$root/target/release/examples/iterative_solver" "$level"
done
rm -rf many cohort
finish
