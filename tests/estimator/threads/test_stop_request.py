"""A stop asked for by a signal handler, at whatever instruction the main thread happens to be."""

from __future__ import annotations

import subprocess
import sys
from threading import Thread

from gritd.estimator.threads.stop_request import StopRequest

SIGNALS = 1500  # a threading.Event hangs within the first few hundred
AT_ONCE = (
    6  # more processes than cores: a SimpleQueue hangs where a time-out ends while it is not run
)
MANY = f"""
import faulthandler, random, signal, sys
from gritd.estimator.threads.stop_request import StopRequest
rng = random.Random(int(sys.argv[1]))
for number in range({SIGNALS}):
    if number % 100 == 0:
        faulthandler.dump_traceback_later(300.0, exit=True)
    stop = StopRequest()
    signal.signal(signal.SIGALRM, lambda *_: stop.set())
    signal.setitimer(signal.ITIMER_REAL, rng.uniform(20e-6, 300e-6))
    while not stop.wait(1e-5):
        pass
"""


def test_no_signal_is_lost_and_none_blocks():
    called = [[sys.executable, "-c", MANY, str(seed)] for seed in range(AT_ONCE)]
    children = [subprocess.Popen(words, stderr=subprocess.PIPE, text=True) for words in called]
    reported = [child.communicate()[1] for child in children]
    assert [child.returncode for child in children] == [0] * AT_ONCE, reported


def test_it_is_not_set_before_and_stays_set_after():
    ending = StopRequest()
    assert not ending.is_set() and not ending.wait(0.001)
    ending.set()
    assert ending.is_set() and ending.wait(0.0) and ending.wait(0.0)


def test_another_thread_wakes_the_waiting_one():
    ending = StopRequest()
    thread = Thread(target=ending.set)
    thread.start()
    assert ending.wait(60.0)
    thread.join()
