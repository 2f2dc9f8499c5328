"""What a foreign library may do to its process; called in a child by the tests of `vjm.child_process`."""

import ctypes
import os
import signal
import sys
import time


def double(value, progress=None):
    if progress is not None:
        progress("half", 1, 2)
    print("what a library prints to standard output")
    os.write(1, b"and past Python\n")
    print("a warning", file=sys.stderr)
    return 2 * value


def read_nowhere():
    """A segmentation fault."""
    ctypes.string_at(0)


def give_up():
    """What C++ does where nobody catches."""
    os.write(2, b"terminate called: no more\n")
    os.abort()


def leave():
    os._exit(3)


def allocate(mib):
    """Working memory that is written to, and is less than a gibibyte where nothing stops it."""
    return len(bytearray(b"\1") * (mib * 2**20))


def work_deaf():
    """A call that answers no signal."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    time.sleep(60.0)


def divide():
    try:
        int("a")
    except ValueError as error:
        raise ModuleNotFoundError("none such", name="such") from error


class OddError(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def raise_odd():
    raise OddError("this", "that")


def report_thrice(progress):
    for k in range(3):
        time.sleep(0.7)
        progress("stage", k, 3)
    return "done"
