"""Maps the slices of a plan over a Dask cluster and retries what fails. Needs the package `distributed` of PyPI."""

import os
import subprocess
import sys
import threading

# Each number of a slice is appended to the command, which has to see the same folders on every worker.
COMMAND = {command}
SLICES = {slices}
# Address of a scheduler; empty: a cluster on this machine, of so many workers, or one a core where that is 0.
SCHEDULER = {scheduler}
WORKERS = {workers}
TRIES = 3
SCHEDULER_SECONDS = 10
# Exit codes that a second try would not change: usage, another device or program, bad input.
LASTING = (2, 3, 4)
STDERR = os.fdopen(os.dup(2), "w")


def end(line):
    """Ends at once with one line: what distributed has running would say more."""
    print(line, file=STDERR, flush=True)
    os._exit(1)


def end_with_parent():
    """Ends when the program that holds the other end of stdin has ended, and with this the workers and their slices."""
    while os.read(0, 4096):
        pass
    os._exit(1)


def run(number, command):
    """Runs one slice, in a process of its own. A worker that dies takes the slice to another worker."""
    # A worker has one core: llvmpipe draws in the thread that asks for it. The slice ends when its stdin does: with this worker.
    environment = {"LP_NUM_THREADS": "0", **os.environ}
    with subprocess.Popen(
        [*command, str(number)], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment
    ) as slice_process:
        said = slice_process.stderr.read().decode(errors="replace").strip().splitlines()
        code = slice_process.wait()
    if code not in (0, *LASTING):
        raise RuntimeError(said[-1] if said else f"exit code {code}")
    return code, said[-1] if said else ""


def main():
    # What distributed and its processes write to stderr goes nowhere.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    try:
        from distributed import Client, LocalCluster, as_completed
    except ImportError:
        end("python3 has no package distributed")
    threading.Thread(target=end_with_parent, daemon=True).start()
    try:
        cluster = SCHEDULER or LocalCluster(n_workers=WORKERS or None, threads_per_worker=1, dashboard_address=None)
        client = Client(cluster, timeout=SCHEDULER_SECONDS)
    except Exception as error:  # of many kinds: an address without meaning, no answer, no room for a cluster
        end(f"{SCHEDULER or 'a cluster on this machine'}: no scheduler answers ({type(error).__name__})")
    futures = client.map(run, SLICES, command=COMMAND, retries=TRIES - 1, pure=False)
    number_of = dict(zip((future.key for future in futures), SLICES))
    failures = []
    for future in as_completed(futures):
        error = future.exception()
        code, said = (1, str(error)) if error else future.result()
        if code:
            failures.append(f"slice {number_of[future.key]}: {said}")
    if failures:
        end(f"{len(failures)} of {len(SLICES)} slices failed; {failures[0]}")
    client.close()


if __name__ == "__main__":
    try:
        main()
    except Exception as error:
        end(f"{type(error).__name__}: {error}")
