"""The `openswim` command line: its commands and exit codes.

Exit codes: 0 done, 1 our fault, 2 the user's mistake or a bad file, 130 interrupted, 141 nobody
reads on what is printed. Heavy modules are
imported by the commands that need them, so that `openswim --help` is quick.
"""

import errno
import gc
import os
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

import click

from openswim import __version__
from openswim.cli.camera_commands import analyse, calibrate, compare, correct_clouds
from openswim.cli.light_commands import aerosol, irradiance, satellite, validate
from openswim.cli.options import debug, known_to
from openswim.cli.sky_commands import batch, demo, film, info, render
from openswim.errors import UserError
from openswim.progress import spoken
from openswim.system.interrupts import INTERRUPTED, watched

# products of matrices are small here, and the threads that wait for them would take time from the kernels'
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# the demo takes as long without huge pages; in virtual machines that give freed memory back they take a fifth more
os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")

_MOST_THREADS = 1024
DONE, OUR_FAULT, USERS_MISTAKE = 0, 1, 2
UNREAD = 141  # as shells say it of a program that a closed pipe ended


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="openswim")
@debug
def cli() -> None:
    """A weather model's file in, a believable sky out."""


for _command in (
    demo, info, render, film, batch, calibrate, compare, correct_clouds, analyse, irradiance, satellite, validate,
    aerosol,
):  # fmt: skip
    cli.add_command(_command)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code; errors are one line on stderr."""
    with watched():
        code = run(arguments)
    gc.freeze()  # looking for garbage among all that was imported would take a third of a second
    sys.exit(code)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    state: dict[str, bool] = {}
    try:
        _check_threads()
        with spoken():
            cli.main(args=arguments, prog_name="openswim", standalone_mode=False, obj=state)
    except UserError as error:
        given = sys.argv[1:] if arguments is None else arguments
        whose = next((cli.commands[each] for each in given if each in cli.commands), None)
        return _fail(known_to(whose, str(error)), USERS_MISTAKE, state)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return USERS_MISTAKE
    except click.ClickException as error:
        command = _asked(error, sys.argv[1:] if arguments is None else arguments)
        return _fail(str(UserError(f"{error.format_message()} (see {command} --help)")), USERS_MISTAKE, state)
    except (click.Abort, KeyboardInterrupt):
        click.echo("openswim: interrupted", err=True)
        return INTERRUPTED
    except SystemExit:  # click's own of a pipe that nobody reads any more; of all else it raises, as it is asked to
        return UNREAD
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            return _fault(error, state)
        _silence()
        return _fail("what is printed cannot be written, as the disk is full: free some space", USERS_MISTAKE, state)
    except MemoryError:
        return _fail("out of memory: use a smaller --size or a smaller domain", USERS_MISTAKE, state)
    except Exception as error:
        return _fault(error, state)
    return DONE


def _fault(error: Exception, state: dict[str, bool]) -> int:
    hint = "" if state.get("debug") else " (a fault of openswim; --debug shows where)"
    return _fail(f"{type(error).__name__}: {error}{hint}", OUR_FAULT, state)


def _silence() -> None:
    """Print nothing more: Python would fail again as it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with suppress(OSError, ValueError, AttributeError):  # no file, or closed
        os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def _check_threads() -> None:
    """Numba takes what it is told: of none it fails, and of very many it starts all."""
    told = os.environ.get("NUMBA_NUM_THREADS") or "1"
    most = max(_MOST_THREADS, os.cpu_count() or 1)
    if not (told.isascii() and told.isdigit() and len(told) < 9 and 1 <= int(told) <= most):
        raise UserError(f"NUMBA_NUM_THREADS is {told[:20]!r}: set it to a number from 1 to {most}, or not at all")


def _asked(error: click.ClickException, arguments: Sequence[str]) -> str:
    """The command that was asked for; click's parser, which misses an option's value, does not say."""
    if (context := getattr(error, "ctx", None)) is not None:
        return str(context.command_path)
    command: click.Command = cli
    path = "openswim"
    for word in arguments:
        if not isinstance(command, click.Group) or word not in command.commands:
            break
        command, path = command.commands[word], f"{path} {word}"
    return path


def _fail(message: str, code: int, state: dict[str, bool]) -> int:
    if state.get("debug"):
        traceback.print_exc()
    click.echo(f"openswim: error: {' '.join(message.split())}", err=True)
    return code
