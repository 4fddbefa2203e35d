"""Pictures of a simulation, without a screen."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from inphase.errors import OptionError

PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"


@contextmanager
def camera(model: Any, name: str, width: int = 480, height: int = 320) -> Iterator[Any]:
    """A function that is given the simulation's data and returns what a camera of its model sees: (H, W, 3) bytes.

    Raises OptionError where nothing can be drawn without a screen.
    """
    os.environ.setdefault("MUJOCO_GL", "egl")  # read when mujoco is imported
    import mujoco

    try:
        renderer = mujoco.Renderer(model, height, width)
    except Exception as error:  # noqa: BLE001 - whatever the driver raises
        raise OptionError(f"a film needs EGL: apt-get install {PACKAGES} ({error})") from None

    def look(data: Any) -> np.ndarray:
        renderer.update_scene(data, camera=name)
        return renderer.render().copy()

    try:
        yield look
    finally:
        renderer.close()
