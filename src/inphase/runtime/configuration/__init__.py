"""One TOML file for an interaction: read, checked with the line of every mistake, and made into a loop."""

from inphase.runtime.configuration.interaction import Configuration, read_configuration
from inphase.runtime.configuration.recording_table import demonstrations
from inphase.runtime.configuration.robot_conduct import no_limits

__all__ = ["Configuration", "demonstrations", "no_limits", "read_configuration"]
