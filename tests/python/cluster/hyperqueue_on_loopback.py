"""Submits a list's submit-hq.sh to HyperQueue's server with two workers on loopback, and kills one worker's task during the run.

PyPI's package contains the engine but no program `hq`. Therefore a substitute `hq` accepts `hq submit` with the script's options, refuses
others, and passes the array to the real server.
"""

import argparse
import os
import pathlib
import subprocess
import sys

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest


KILLER = pathlib.Path(__file__).with_name("with_a_worker_killed.py")


def submitted(arguments, client, killed=None):
    """Submits a job as `hq submit` would with these arguments. With `killed`, the first task's first worker process is killed, and its number is written there."""
    parser = argparse.ArgumentParser(prog="hq submit")
    parser.add_argument("--name", required=True)
    parser.add_argument("--array", required=True)
    parser.add_argument("--cpus", required=True)
    parser.add_argument("--resource", action="append", default=[])
    parser.add_argument("--time-limit", required=True)
    parser.add_argument("--crash-limit", type=int, required=True)
    parser.add_argument("--stdout", required=True)
    parser.add_argument("--stderr", required=True)
    own, command = arguments[: arguments.index("--")], arguments[arguments.index("--") + 1 :]
    asked = parser.parse_args(own)
    assert asked.time_limit.endswith("m") and asked.resource[0].startswith("mem="), asked
    first, last = map(int, asked.array.split("-"))
    job = Job(name=asked.name, max_fails=None)
    for task in range(first, last + 1):
        log = asked.stdout.replace("%{TASK_ID}", str(task))
        is_disturbed = killed is not None and task == first
        job.program(
            [sys.executable, str(KILLER), str(killed), *command] if is_disturbed else command,
            # A job with one program per task numbers its tasks itself; an array of `hq submit` has these numbers.
            env={"HQ_TASK_ID": str(task)},
            stdout=log,
            stderr=log + ".err",
            resources=ResourceRequest(cpus=asked.cpus),
            crash_limit=asked.crash_limit,
        )
    return client.submit(job)


def arguments_of(script):
    """Arguments of a script's call of `hq`."""
    folder = script.parent / "hq-words"
    folder.mkdir()
    stand_in = folder / "hq"
    stand_in.write_text('#!/usr/bin/env bash\nprintf "%s\\0" "$@"\n', encoding="utf-8")
    stand_in.chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}
    said = subprocess.run([script], env=environment, stdout=subprocess.PIPE, check=True).stdout
    words = said.decode().split("\0")[:-1]
    assert words[0] == "submit", words
    return words[1:]


def main():
    directory, server = map(pathlib.Path, sys.argv[1:])
    words = arguments_of(directory / "submit-hq.sh")
    killed = directory / "killed"
    with LocalCluster(server_dir=str(server)) as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        client = cluster.client()
        assert client.wait_for_jobs([submitted(words, client, killed)]), "a task failed"
        assert killed.exists(), "no worker was killed"
        # Submitted again: all results exist.
        assert client.wait_for_jobs([submitted(words, client)]), "a task failed the second time"


main()
