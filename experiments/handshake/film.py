"""Fast, slow and still: a camera in the room, and a person whose arm goes where the hand is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.bodies.person import Person
from experiments.handshake.anatomy import MUSCLES
from experiments.handshake.look import dressed, place
from experiments.handshake.robot import Arm
from experiments.handshake.trial import leading, led
from experiments.handshake.work import learned
from experiments.handshake.world import written
from experiments.study.film import camera
from experiments.study.stored import Stored

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FPS, UNTIL = 15, 7.0  # pictures a second, of the first seconds
SHOWN = {"fast": (3, "fast"), "slow": (4, "slow"), "still": (5, "still")}
METHOD = "rbpf"
RELAXED, TENSE = np.array([0.62, 0.42, 0.38]), np.array([0.85, 0.10, 0.08])  # colours of 0 and 0.6 MPa


def acted(name: str, models: Stored, seed: int) -> Mapping[str, Any]:
    """frames: (F, H, W, 3) of one test."""
    model, ends = learned(models, "calibrated")
    person, speed = SHOWN[name]
    frames: list[np.ndarray] = []
    world, mannequin = dressed(written(drawn=True))
    with camera(world, "side") as look:

        def picture(arm: Arm) -> None:
            if arm.data.time < UNTIL:
                pose(arm, mannequin)
                frames.append(look(arm.data))

        led(METHOD, model, leading(person, speed, 0, ends, seed), seed, picture, world)
    return {"frames": np.array(frames)}


def pose(arm: Arm, person: Person) -> None:
    """Colour the muscles by their pressures, and let the person's arm follow their hand."""
    share = np.clip(arm.air.pressure / 0.5, 0, 1)[:, None]
    for name, colour in zip(MUSCLES, RELAXED + share * (TENSE - RELAXED), strict=True):
        arm.model.tendon_rgba[arm.model.tendon(f"{name}_line").id, :3] = colour
    place(arm, person)


def strip(films: Mapping[str, np.ndarray]) -> Figure:
    """Key frames, a row for each film."""
    from matplotlib.figure import Figure as New

    columns = 7
    height, width = next(iter(films.values())).shape[1:3]
    figure = New(figsize=(2.1 * columns, 2.1 * columns * height / width / columns * len(films) + 0.6))
    axes = figure.subplots(len(films), columns, squeeze=False)
    for row, (name, frames) in zip(axes, films.items(), strict=True):
        for i, ax in enumerate(row):
            frame = min(round((0.3 + 0.9 * i) * FPS), len(frames) - 1)
            ax.imshow(frames[frame])
            ax.set_axis_off()
            if i == 0:
                ax.set_title(name, fontsize=10, loc="left")
    figure.subplots_adjust(0.005, 0.005, 0.995, 0.94, wspace=0.02, hspace=0.16)
    return figure
