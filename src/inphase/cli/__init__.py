"""The command line: one file a sub-command; it only asks the library and prints what it answers."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence

from inphase.errors import InphaseError

BAD_INPUT, STOPPED = 2, 130  # exit codes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0, or 2 with one clear line on bad input."""
    try:
        try:
            return _run(sys.argv[1:] if arguments is None else list(arguments))
        finally:
            sys.stdout.flush()  # a reader that has gone shows here, and not when Python ends
    except BrokenPipeError:  # as `head` does; what is still to be said goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (InphaseError, OSError) as error:
        print("inphase:", " ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("inphase: stopped", file=sys.stderr)
        return STOPPED


def _run(arguments: Sequence[str]) -> int:
    import scipy.linalg  # noqa: F401 - it brings a BLAS of its own, which can be limited once it is there
    import tyro
    from threadpoolctl import threadpool_limits

    from inphase.cli.bags import bags
    from inphase.cli.demo import demo
    from inphase.cli.evaluate import evaluate
    from inphase.cli.experiment import experiment
    from inphase.cli.fit import fit
    from inphase.cli.inspect import inspect
    from inphase.cli.live import live
    from inphase.cli.record import record
    from inphase.cli.replay import replay
    from inphase.cli.replay_run import is_of_run, replay_run
    from inphase.cli.report import report
    from inphase.cli.select import select
    from inphase.cli.studio import studio
    from inphase.cli.validate import validate

    commands: dict[str, Callable[..., int]] = {
        "demo": demo,
        "validate": validate,
        "fit": fit,
        "inspect": inspect,
        "replay": replay_run if arguments[:1] == ["replay"] and is_of_run(arguments[1:]) else replay,
        "evaluate": evaluate,
        "select": select,
        "report": report,
        "bags": bags,
        "record": record,
        "live": live,
        "studio": studio,
        "experiment": experiment,
    }
    # The products of a filter are small: two threads make each slower, many times so on a busy machine.
    with threadpool_limits(limits=1):
        code: int = tyro.extras.subcommand_cli_from_dict(
            commands,
            prog="inphase",
            description="Learn from recordings how two partners move together, then move with one of them live.",
            args=arguments,
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone),
        )
    return code
