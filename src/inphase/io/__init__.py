"""Files in, values out: recordings as CSV and npz (`load`), and model files; nothing else in the core opens a file."""

from inphase.io.files import find_episodes
from inphase.io.load import load, pick_roles, read_episode
from inphase.io.table import Table

__all__ = ["Table", "find_episodes", "load", "pick_roles", "read_episode"]
