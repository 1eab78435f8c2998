"""The entry point of the command line: answers Ctrl-C and closed outputs before libraries are imported."""

import os
import signal
import sys


def main() -> None:
    """Run the command line; see `app.main` for what it returns to the shell."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, stopped)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")
    if sys.stdout is None:
        print("drake-ispace: standard output: is closed, expected a place to print to", file=sys.stderr)
        sys.exit(2)
    for stream in (sys.stdout, sys.stderr):  # a name or a unit must not stop a command where the locale lacks a letter
        stream.reconfigure(errors="backslashreplace")
    from drake_ispace.cli.app import main

    if signal.getsignal(signal.SIGINT) is stopped:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    main()


def stopped(number, frame):
    """End at once: what a process that ends so has begun to write is cleared away by the next."""
    os.write(2, b"drake-ispace: stopped, nothing half-written is left behind\n")
    os._exit(130)  # Python's own way out crashes where the import of Drake was interrupted
