"""The ``thesis`` command, run in this process: what a process of its own would say, in no time."""

import contextlib
import io
import shlex
import signal
import sys
import warnings
from dataclasses import dataclass

import pytest

from thesis_lib import cli
from thesis_lib.runs import command_line


@dataclass(frozen=True)
class Done:
    """How a command ended, what it said, and what Python warned of."""

    status: int
    out: str
    err: str
    warned: tuple[str, ...] = ()


def hears_signals():
    """Undo what a shell ignores for jobs in the background and ``nohup``."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def thesis(*arguments, cwd="."):
    """Run the command in this process, as a shell would in the folder `cwd`."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        patch.setattr(sys, "argv", ["thesis", *map(str, arguments)])
        # The tests keep handlers and warnings.
        patch.setattr(command_line, "isolate_process", lambda: None)
        with (
            contextlib.chdir(cwd),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            pytest.raises(SystemExit) as end,
        ):
            cli.main()
    warned = [
        str(w.message) for w in caught if issubclass(w.category, RuntimeWarning | UserWarning)
    ]
    return Done(int(end.value.code or 0), out.getvalue(), err.getvalue(), tuple(warned))


def refusal(done):
    """The one line of a refused request."""
    assert (done.status, done.out) == (2, ""), done.err
    assert done.err.endswith("\n")
    assert len(done.err.splitlines()) == 1, done.err
    return done.err.strip()


def read_command(line):
    """Figure set or chapter and parameters of a ``thesis run``, as the command reads them."""
    program, run, name, *options = shlex.split(line)
    assert (program, run) == ("thesis", "run")
    assert set(options[::2]) <= {"-p"}
    return name, command_line.parse_assignments(options[1::2])
