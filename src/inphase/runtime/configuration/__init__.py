"""One TOML file for an interaction: read, checked with the line of every mistake, and made into a loop."""

from inphase.runtime.configuration.interaction import Configuration, no_limits, read_configuration

__all__ = ["Configuration", "no_limits", "read_configuration"]
