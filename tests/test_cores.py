"""One process per core: the loss of one is reported and not waited for."""

import signal
import subprocess
import sys

import psutil

from mjxgait.processes import process_per_core

LOSES_ONE = """
import multiprocessing, threading, time
from concurrent.futures.process import BrokenProcessPool
from mjxgait.processes import process_per_core

def kill_the_first():
    while not (children := multiprocessing.active_children()):
        time.sleep(0.0005)
    children[0].kill()

for _ in range(8):  # the moment decides
    killer = threading.Thread(target=kill_the_first)
    killer.start()
    try:
        with process_per_core(4) as pool:
            killer.join()
            list(pool.map(time.sleep, [0.5] * 4))
    except BrokenProcessPool:
        print("lost")
"""


def test_a_process_killed_at_its_start_is_not_waited_for():
    done = subprocess.run(
        [sys.executable, "-c", LOSES_ONE], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout.split() == ["lost"] * 8, done.stderr


WAITS = """
import os, time
from mjxgait.processes import process_per_core

with process_per_core(2) as pool:
    print(*{pool.submit(os.getpid).result() for _ in range(9)}, flush=True)
    time.sleep(60)
"""


def test_processes_end_with_a_killed_parent():
    """Without work they would wait for it forever, with all their memory."""
    with subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        children = [psutil.Process(int(number)) for number in run.stdout.readline().split()]
        run.kill()
    assert children
    assert not psutil.wait_procs(children, timeout=20)[1]


def test_ctrl_c_does_not_reach_a_process_that_is_importing():
    """The signal is blocked there from the start; this process unblocks it again."""
    with process_per_core(1) as pool:
        held = pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result()
    assert signal.SIGINT in held
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
