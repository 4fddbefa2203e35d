"""The command line: one file a sub-command; it only asks the library and prints what it answers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from inphase.errors import InphaseError

BAD_INPUT = 2  # exit code


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0, or 2 with one clear line on bad input."""
    import tyro

    from inphase.cli.demo import demo
    from inphase.cli.fit import fit
    from inphase.cli.inspect import inspect
    from inphase.cli.replay import replay
    from inphase.cli.validate import validate

    commands: dict[str, Callable[..., int]] = {
        "demo": demo,
        "validate": validate,
        "fit": fit,
        "inspect": inspect,
        "replay": replay,
    }
    try:
        code: int = tyro.extras.subcommand_cli_from_dict(
            commands,
            prog="inphase",
            description="Learn from recordings how two partners move together, then move with one of them live.",
            args=sys.argv[1:] if arguments is None else list(arguments),
        )
    except InphaseError as error:
        print(f"inphase: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("inphase: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        sys.stderr.close()
        return 0
    return code
