"""Maps the slices of a plan over a Dask cluster and retries what fails.

    python3 farm_dask.py --workers 2 SLICES PROGRAM farm run PLAN --slice
    python3 farm_dask.py --scheduler tcp://host:8786 SLICES PROGRAM farm run PLAN --slice

SLICES is a file with a number a line. Each is appended to the command, which has to see the same folders on every worker.
Needs the package `distributed` of PyPI.
"""

import argparse
import os
import subprocess
import sys

TRIES = 3
# Exit codes that a second try would not change: usage, another device or program, bad input.
LASTING = (2, 3, 4)


def run(number, command):
    """Runs one slice, in a process of its own. A worker that dies takes the slice to another worker."""
    # A worker has one core: llvmpipe draws in the thread that asks for it.
    environment = {"LP_NUM_THREADS": "0", **os.environ}
    done = subprocess.run(
        [*command, number], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, env=environment
    )
    said = done.stderr.strip().splitlines()
    if done.returncode not in (0, *LASTING):
        raise RuntimeError(said[-1] if said else f"exit code {done.returncode}")
    return done.returncode, said[-1] if said else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scheduler", help="address of a Dask scheduler; default: a cluster on this machine")
    parser.add_argument("--workers", type=int, default=None, help="worker processes of that cluster; default: one a core")
    parser.add_argument("slices")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    arguments = parser.parse_args()

    from distributed import Client, LocalCluster, as_completed

    if arguments.scheduler:
        client = Client(arguments.scheduler)
    else:
        client = Client(LocalCluster(n_workers=arguments.workers, threads_per_worker=1, dashboard_address=None))
    with open(arguments.slices, encoding="utf-8") as file:
        numbers = file.read().split()
    failed = 0
    with client:
        futures = client.map(run, numbers, command=arguments.command, retries=TRIES - 1, pure=False)
        number_of = dict(zip((future.key for future in futures), numbers))
        for future in as_completed(futures):
            error = future.exception()
            code, said = (1, str(error)) if error else future.result()
            if code:
                failed += 1
                print(f"slice {number_of[future.key]}: {said}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
