# Sourced by every campaign's run.sh. A campaign runs the release build, writes raw output below target/campaigns/NAME (not kept) and one result.json beside
# its script: seeds, command lines, commit, processor, duration, and the figures that README and docs may quote.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
export VITREO_UQ_CACHE=${VITREO_UQ_CACHE:-$root/target/cache}
program=$root/target/release/vitreo-uq
python=${PYTHON:-python3}

# begin NAME [none]: builds the program, unless the campaign needs none, and clears the raw output. With RESUME=1 the output is kept, and commands that came to their end are not run again.
begin() {
    name=$1
    raw=$root/target/campaigns/$name
    if [[ -z ${RESUME:-} ]]; then
        rm -rf "$raw"
    fi
    mkdir -p "$raw"
    if [[ ${2:-} != none ]]; then
        cargo build --release --quiet --locked --bins --examples
    fi
}

# measured FOLDER: sets `data` to ../shared/data, and ends the campaign if the folder is not there.
measured() {
    data=$root/../shared/data
    if [[ ! -d $data/$1 ]]; then
        echo "measured records are not here ($data/$1): nothing was run" >&2
        exit 0
    fi
}

# shown PROGRAM ARGUMENTS…: a command line as results quote it.
shown() {
    local words=("$@")
    words[0]=$(basename "$1")
    printf '%s' "${words[*]//$root\//}"
}

# is_done LABEL PROGRAM ARGUMENTS…: whether this very command came to its end before: one of another COUNT did not.
is_done() {
    local label=$1 before=
    shift
    if [[ -e $raw/$label.done ]]; then
        read -r before <"$raw/$label.done"
    fi
    [[ $before == "$(shown "$@")" ]]
}

# note LABEL STARTED PROGRAM ARGUMENTS…: what was run, how long it took, at which commit; marked where the work tree differs from that in more than results.
note() {
    local label=$1 started=$2 mark=
    shift 2
    if [[ -n $(git status --porcelain | grep -v 'result\.json$') ]]; then
        mark=' and changes'
    fi
    printf '%s\n' "$(shown "$@")" "$(git rev-parse --short=12 HEAD)$mark" "$(($(date +%s) - started))" >"$raw/$label.done"
}

# run_in LABEL PROGRAM ARGUMENTS…: runs a command, keeps its words in LABEL.txt, notes the command line. Exit code 1 (not to be trusted) is a result; others end the campaign.
run_in() {
    local label=$1 started
    shift
    if is_done "$label" "$@"; then
        return
    fi
    started=$(date +%s)
    local code=0
    "$@" >"$raw/$label.txt" 2>"$raw/$label.log" || code=$?
    # A Python program that breaks down also ends with 1.
    if ((code > 1)) || { ((code == 1)) && grep -q '^Traceback' "$raw/$label.log"; }; then
        printf '%s failed with %s:\n' "$label" "$code" >&2
        tail -n 5 "$raw/$label.log" >&2
        exit "$code"
    fi
    note "$label" "$started" "$@"
}

# in_parts LABEL COUNT SIZE PROGRAM ARGUMENTS…: a program that takes --count, --first and --json, in parts of SIZE, so that RESUME=1 loses little; documents in
# LABEL.FIRST.json.
in_parts() {
    local label=$1 count=$2 size=$3 first
    shift 3
    for ((first = 0; first < count; first += size)); do
        run_in "$label.$first" "$@" --json "$raw/$label.$first.json" --count $((count - first < size ? count - first : size)) --first "$first"
    done
}

# play LABEL COUNT ARGUMENTS…: `challenge run` of so many.
plays_a_part=50
play() {
    local label=$1 count=$2
    shift 2
    in_parts "$label" "$count" "$plays_a_part" "$program" challenge run --quiet --cache "$VITREO_UQ_CACHE/trajectories" "$@"
}

# finish: has figures.py of the campaign read the raw output, and writes result.json.
finish() {
    "$python" "$root/campaigns/result.py" "$name" "$raw"
}

# timed LABEL PROGRAM ARGUMENTS…: runs a command three times in an empty directory each and notes seconds of wall clock and of processor in LABEL.seconds.
timed() {
    local label=$1 place run started
    shift
    if is_done "$label" "$@"; then
        return
    fi
    rm -f "$raw/$label.seconds"
    started=$(date +%s)
    for run in 1 2 3; do
        place=$raw/work
        rm -rf "$place"
        mkdir -p "$place"
        (cd "$place" && run_timed "$label" "$@")
    done
    note "$label" "$started" "$@"
}

# One run of `timed`, in the present directory.
run_timed() {
    local label=$1
    shift
    local code=0
    TIMEFORMAT='%R %U %S'
    { time "$@" >"$raw/$label.txt" 2>"$raw/$label.log" || code=$?; } 2>>"$raw/$label.seconds"
    if ((code > 1)); then
        printf '%s failed with %s:\n' "$label" "$code" >&2
        tail -n 5 "$raw/$label.log" >&2
        exit "$code"
    fi
}
