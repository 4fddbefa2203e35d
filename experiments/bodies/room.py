"""A bright room to film in: floor, sky and light, which do not touch anything but for the floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def add_room(spec: Any, tile: float = 0.5) -> None:
    """A tiled floor at height 0, a light sky, a lamp with shadows and a soft one, in a world (mujoco.MjSpec)."""
    import mujoco

    pale, paler = [0.80, 0.81, 0.82], [0.86, 0.87, 0.88]
    sky = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT}
    spec.add_texture(name="sky", rgb1=[0.93, 0.95, 0.97], rgb2=[0.72, 0.78, 0.84], width=256, height=256, **sky)
    tiles = {"type": mujoco.mjtTexture.mjTEXTURE_2D, "builtin": mujoco.mjtBuiltin.mjBUILTIN_CHECKER}
    spec.add_texture(name="tiles", rgb1=pale, rgb2=paler, width=256, height=256, **tiles)
    material = spec.add_material(name="floor", texrepeat=[0.5 / tile] * 2, texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 0.1], material="floor")
    spec.worldbody.add_light(pos=[2, -3, 5], dir=[-0.1, 0.5, -1], diffuse=[0.45] * 3, castshadow=True)
    spec.worldbody.add_light(pos=[0, 3, 4], dir=[0.1, -0.5, -1], diffuse=[0.2] * 3, castshadow=False)
    spec.visual.headlight.ambient = [0.42] * 3
    spec.visual.headlight.diffuse = [0.25] * 3
    spec.visual.headlight.specular = [0.1] * 3
    spec.visual.quality.shadowsize = 4096


def add_camera(spec: Any, name: str, at: Sequence[float], to: Sequence[float], fovy: float = 45.0) -> None:
    """A camera [m] that looks at a point [m]. fovy: how much it sees upright [degrees]."""
    import mujoco

    back = np.asarray(at, dtype=np.float64) - to
    right = np.cross([0.0, 0.0, 1.0], back)
    axes = np.column_stack([right, np.cross(back, right), back])
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, (axes / np.linalg.norm(axes, axis=0)).ravel())
    spec.worldbody.add_camera(name=name, pos=list(at), quat=quaternion, fovy=fovy)
