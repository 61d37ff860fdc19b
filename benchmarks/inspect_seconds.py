"""Median processor seconds of `mjxgait inspect RUN`; should stay below 3.

python benchmarks/inspect_seconds.py runs/every/duck-0 --times 5
"""

import argparse
import resource
import statistics
import subprocess

from mjxgait.processes import python_command


def seconds(run: str) -> float:
    """Seconds of one call, of all its processes; other load on the machine changes it little."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = python_command("mjxgait", "inspect", run, "--json")
    subprocess.run(command, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("run", help="folder of a run")
    parser.add_argument("--times", type=int, default=5)
    told = parser.parse_args()
    each = [seconds(told.run) for _ in range(told.times)]
    print(f"median {statistics.median(each):.2f} s of {', '.join(f'{s:.2f}' for s in each)}")


if __name__ == "__main__":
    main()
