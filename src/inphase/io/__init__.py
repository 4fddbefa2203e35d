"""Files in, values out: recordings as CSV and npz (`load`), live runs as MCAP, model files, and files of IntPrim.

Nothing else in the core opens a file.
"""

from inphase.io.atomic import whole_file
from inphase.io.edit_notes import edit_notes
from inphase.io.files import find_episodes
from inphase.io.intprim_analysis import read_analysis
from inphase.io.intprim_analysis_writer import AnalysisHead, AnalysisStep, write_analysis
from inphase.io.intprim_model import OldModel, read_bip
from inphase.io.load import load, pick_roles, read_episode
from inphase.io.mcap_follow import Follower, News, follow_recording
from inphase.io.mcap_recording import read_recorded_model, read_recording
from inphase.io.notes import Note, read_notes
from inphase.io.table import Table

__all__ = [
    "AnalysisHead",
    "AnalysisStep",
    "Follower",
    "News",
    "Note",
    "OldModel",
    "Table",
    "edit_notes",
    "find_episodes",
    "follow_recording",
    "load",
    "pick_roles",
    "read_analysis",
    "read_bip",
    "read_episode",
    "read_notes",
    "read_recorded_model",
    "read_recording",
    "whole_file",
    "write_analysis",
]
