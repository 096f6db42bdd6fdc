#!/usr/bin/env bash
# Runs a list of tasks under the engines of laboratories. HyperQueue has its server and two workers on loopback, from PyPI, in an environment of its own under
# target/. Slurm has a controller and one node on this machine, as root, from Debian's slurmctld, slurmd, slurm-client and munge. The engines' files must equal
# those of one machine, byte for byte. A killed worker, a truncated result and a full disk must be detected. Takes less than three minutes once the
# program is built. Engines that are not available here are skipped with a message.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD

python=${PYTHON:-python3}
requirements=$root/tests/python/cluster-requirements.txt
environment=$root/target/cluster-checks-venv
place=$(mktemp -d "${TMPDIR:-/tmp}/vitreo-uq-cluster.XXXXXX")
pids=()
passed=0 skipped=0

fail() {
    printf 'cluster-checks: %s\n' "$1" >&2
    exit 1
}

source scripts/environment.sh

# Ends the processes started here and no others.
cleanup() {
    local pid
    for pid in "${pids[@]}"; do
        kill "$pid" 2>/dev/null || true
    done
    # They write into their directory until they have ended.
    wait "${pids[@]}" 2>/dev/null || true
    if [[ -d $place/small ]] && mountpoint -q "$place/small"; then
        umount "$place/small"
    fi
    if [[ -z ${KEEP:-} ]]; then
        rm -rf "$place"
    fi
}
trap cleanup EXIT

pass() {
    passed=$((passed + 1))
    printf '%s: passed\n' "$1"
}

skip() {
    skipped=$((skipped + 1))
    printf '%s: SKIPPED: %s\n' "$1" "$2"
}

# wait_for SECONDS WHAT COMMAND…: waits until the command succeeds.
wait_for() {
    local seconds=$1 what=$2 end=$((SECONDS + $1))
    shift 2
    until "$@" >/dev/null 2>&1; do
        ((SECONDS < end)) || fail "$what did not come within $seconds s"
        sleep 0.2
    done
}

# VITREO_UQ=… uses another build than the one of the tests.
if [[ -z ${VITREO_UQ:-} ]]; then
    cargo build --quiet --examples --bins
fi
program=${VITREO_UQ:-$root/target/debug/vitreo-uq}
export VITREO_UQ_CACHE=${VITREO_UQ_CACHE:-$root/target/cache}
cd "$place"
# Eight records of an instrument and their comparison on one machine. It has so few sweeps of the population that the result is not trusted, which does not matter here.
command -v "$python" >/dev/null || fail "$python is not installed; install Python 3.9 or newer, or set PYTHON"
"$python" "$root/campaigns/scale/specimens.py" 8 cohort
compared() {
    "$program" groups cohort --sweeps 400 --out "$1" --quiet >"$2" || (($? == 1))
}
compared one one.txt

# new_list DIR: the same eyes as tasks, one each.
new_list() {
    "$program" tasks sample cohort --out "$1" --quiet >/dev/null
}

# gathered DIR NAME: gathers the results and compares them with those of one machine.
gathered() {
    "$program" gather "$1" --quiet >"$1.txt" || { cat "$1.txt" >&2; fail "$2: results are missing"; }
    diff -r one/experiments "$1/gathered/experiments" >&2 || fail "$2: other bytes than on one machine"
}

## Here, with two workers.
new_list local
"$program" tasks run local --jobs 2 --quiet >/dev/null
gathered local 'local workers'
"$program" tasks run local --quiet | grep -q '^0 tasks finished' || fail 'tasks whose results are there were run again'
compared local/gathered two.txt
diff one.txt two.txt >&2 && diff -r one local/gathered >&2 || fail 'groups says something else of what was gathered'
pass 'local workers'

## A truncated result, and one of another task.
results=(local/results/*)
truncate -s -20 "${results[0]}"
cp "${results[2]}" "${results[1]}"
code=0
"$program" gather local --quiet --json missing.json >/dev/null || code=$?
((code == 1)) || fail "gather ended with $code where results are damaged"
grep -q '"fault": "truncated"' missing.json && grep -q '"fault": "other-task"' missing.json || fail 'damage was not named'
"$program" tasks run local --quiet | grep -q '^2 tasks finished' || fail 'damaged results were not run again'
gathered local 'damaged results'
pass 'damaged results'

## A full disk: 256 KiB, which takes a result or two.
if ((EUID == 0)) && mkdir small && mount -t tmpfs -o size=256k vitreo-uq "$place/small" 2>/dev/null; then
    new_list small
    code=0
    "$program" tasks run small --jobs 2 --quiet >full.txt 2>&1 || code=$?
    ((code == 1)) && grep -q 'No space left on device' full.txt || fail "a full disk was not named: $(<full.txt)"
    mount -o remount,size=64m "$place/small"
    "$program" tasks run small --jobs 2 --quiet >/dev/null || fail 'a disk with room again did not help'
    gathered small 'full disk'
    umount "$place/small"
    pass 'full disk'
else
    skip 'full disk' 'a small disk cannot be mounted here (not root, or not permitted)'
fi

## HyperQueue. PyPI's package has the engine as a library; where the program `hq` is installed, the script is submitted by it.
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))'; then
    skip HyperQueue 'Python 3.9 or newer is not installed; set PYTHON'
else
    if ! python_environment "$environment" "$requirements"; then
        skip HyperQueue "cannot install $requirements; the network is needed the first time"
    else
        new_list hq
        "$program" tasks run hq --engine hq --parts 4 --memory-mib 500 --minutes 5 >/dev/null
        "$environment/bin/python" "$root/tests/python/cluster/hyperqueue_on_loopback.py" "$place/hq" "$place/hq-server" >hq.txt 2>&1 ||
            { cat hq.txt >&2; fail 'HyperQueue did not run the list'; }
        gathered hq HyperQueue
        pass HyperQueue
    fi
fi

## Slurm: one node, whose cores are said to be two, so that two parts run at once.
# As root on Debian and Ubuntu, missing packages are installed; this starts no services.
missing() {
    local tool
    for tool in munged slurmctld slurmd sbatch squeue scancel; do
        command -v "$tool" >/dev/null || printf ' %s' "$tool"
    done
}
if [[ -n $(missing) ]] && ((EUID == 0)) && command -v apt-get >/dev/null; then
    { apt-get update -qq && RUNLEVEL=1 DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge; } >/dev/null 2>apt.txt ||
        cat apt.txt >&2
fi
missing=$(missing)
if [[ -n $missing ]]; then
    skip Slurm "not installed:$missing (on Debian and Ubuntu, as root: apt-get install slurmctld slurmd slurm-client munge)"
elif ((EUID != 0)); then
    skip Slurm 'slurmd can be started by root only'
else
    mkdir -p slurm/state slurm/spool slurm/munge
    chmod 755 "$place" slurm
    head -c 64 /dev/urandom >slurm/munge/key
    chmod 700 slurm/munge
    chmod 400 slurm/munge/key
    socket=$place/slurm/munge.socket
    munged --foreground --force --num-threads 2 --key-file "$place/slurm/munge/key" --socket "$socket" \
        --pid-file "$place/slurm/munge/pid" --log-file "$place/slurm/munge/log" --seed-file "$place/slurm/munge/seed" >slurm/munged.txt 2>&1 &
    pids+=($!)
    wait_for 10 'the socket of munged' test -S "$socket"
    node=$(hostname -s)
    cat >slurm/slurm.conf <<CONF
ClusterName=checks
SlurmctldHost=$node(127.0.0.1)
SlurmUser=root
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$socket
CredType=cred/munge
StateSaveLocation=$place/slurm/state
SlurmdSpoolDir=$place/slurm/spool
SlurmctldPidFile=$place/slurm/slurmctld.pid
SlurmdPidFile=$place/slurm/slurmd.pid
SlurmctldLogFile=$place/slurm/slurmctld.log
SlurmdLogFile=$place/slurm/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,batch_sched_delay=0
ReturnToService=2
NodeName=$node NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes=$node Default=YES State=UP MaxTime=60
CONF
    export SLURM_CONF=$place/slurm/slurm.conf
    slurmctld -D -i >slurm/slurmctld.txt 2>&1 &
    pids+=($!)
    slurmd -D >slurm/slurmd.txt 2>&1 &
    pids+=($!)
    is_idle() { [[ $(sinfo --noheader --format %t) == idle* ]]; }
    wait_for 60 'an idle node of Slurm' is_idle
    new_list slurm-list
    "$program" tasks run slurm-list --engine slurm --parts 4 --memory-mib 500 --minutes 5 >/dev/null
    has_ended() { [[ -z $(squeue --noheader --jobs "$1" 2>/dev/null) ]]; }
    # One part is ended while it runs, and another is run twice, because the script is submitted again.
    job=$(sbatch --parsable slurm-list/submit-slurm.sh)
    scancel "${job}_3"
    again=$(sbatch --parsable slurm-list/submit-slurm.sh)
    wait_for 90 'the end of the array' has_ended "$job"
    wait_for 90 'the end of the array that was submitted again' has_ended "$again"
    gathered slurm-list Slurm
    pass Slurm
fi

printf '%d passed, %d skipped, in %d s\n' "$passed" "$skipped" "$SECONDS"
