"""One TOML file for an interaction: read, checked with the line of every mistake, and made into a loop."""

from inphase.runtime.configuration.interaction import Configuration, no_limits, read_configuration
from inphase.runtime.configuration.recording_table import demonstrations

__all__ = ["Configuration", "demonstrations", "no_limits", "read_configuration"]
