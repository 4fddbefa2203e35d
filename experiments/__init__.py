"""The studies of the dissertation, made again: a folder each, run by `inphase experiment NAME`."""

import os

os.environ.setdefault("MUJOCO_GL", "egl")  # films are drawn without a screen; read when mujoco is imported
