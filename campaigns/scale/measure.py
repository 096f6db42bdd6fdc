"""Runs a command, once or --times N, and prints what it took: mean seconds of wall clock and of processor, and the most memory of a process, in MiB."""

import json
import resource
import subprocess
import sys
import time


def main():
    words, times = sys.argv[1:], 1
    if words[0] == "--times":
        times, words = int(words[1]), words[2:]
    began = time.monotonic()
    for _ in range(times):
        code = subprocess.run(words, stdout=subprocess.DEVNULL, check=False).returncode
        if code > 1:
            sys.exit(code)
    wall = (time.monotonic() - began) / times
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = (used.ru_utime + used.ru_stime) / times
    print(json.dumps({"wall_s": wall, "processor_s": processor, "peak_mib": used.ru_maxrss / 1024}))


main()
