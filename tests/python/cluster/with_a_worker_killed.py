"""Runs a command and kills the first worker that it starts: NOTE COMMAND…. The worker's number is written into NOTE."""

import os
import pathlib
import signal
import subprocess
import sys


def workers_of(process):
    """Numbers of a process's children that serve tasks. Each thread has its own list of children."""
    for children in pathlib.Path(f"/proc/{process.pid}/task").glob("*/children"):
        try:
            numbers = children.read_text(encoding="ascii").split()
        except OSError:
            continue  # The thread has ended.
        for number in numbers:
            try:
                words = pathlib.Path(f"/proc/{number}/cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            # Between fork and exec a child has its parent's command line.
            if b"--serve" in words:
                yield int(number)


def main():
    note, command = pathlib.Path(sys.argv[1]), sys.argv[2:]
    process = subprocess.Popen(command)
    # No pause: a worker lives as long as its tasks take, which may be a tenth of a second.
    while process.poll() is None:
        worker = next(workers_of(process), None)
        if worker is not None:
            os.kill(worker, signal.SIGKILL)
            note.write_text(f"{worker}\n", encoding="ascii")
            break
    sys.exit(process.wait())


main()
