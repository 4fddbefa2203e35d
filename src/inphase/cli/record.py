"""`inphase record`: demonstrations from live sensors into a folder, as a configuration file says."""

from __future__ import annotations

from pathlib import Path

import tyro

from inphase.cli.console import Output
from inphase.cli.keys import Keys
from inphase.cli.record_demonstrations import record_demonstrations
from inphase.runtime.clock import SystemClock
from inphase.runtime.configuration import demonstrations, read_configuration

NOTHING_KEPT = 1  # exit code


def record(config: tyro.conf.Positional[Path]) -> int:
    """Record demonstrations: start, stop, discard and do again, one file an episode. Exit code 1 where none was kept.

    By key: space or Enter starts and stops, d discards, r records the last again, q quits. By signal: SIGUSR1 starts
    and stops, SIGUSR2 discards. By a channel, such as a pedal's: `trigger` in the table [demonstrations].

    Args:
        config: the sensors and the channels, a TOML file: docs/live.md
    """
    configuration = read_configuration(config)
    clock = SystemClock()
    session = demonstrations(configuration, clock)
    with session, Keys() as keys:
        kept = record_demonstrations(session, clock, keys, Output())
    return 0 if kept else NOTHING_KEPT
