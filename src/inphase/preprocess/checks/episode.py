"""All checks of one episode, and of a whole data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from inphase.channels import Channel
from inphase.preprocess.checks.across import Episode, check_episodes, check_shape
from inphase.preprocess.checks.clock import check_clock
from inphase.preprocess.checks.finding import EVERY_EPISODE, Finding
from inphase.preprocess.checks.jumps import check_jumps
from inphase.preprocess.checks.rotation import check_quaternions
from inphase.preprocess.checks.stillness import check_values
from inphase.preprocess.checks.tracks import usual_spreads


def check(episodes: Sequence[Episode], channels: Sequence[Channel]) -> list[Finding]:
    """All that is wrong with a data set: every episode by itself, then what shows across them, each fault once."""
    across = check_episodes(episodes, channels)
    known = {(finding.channel, finding.kind) for finding in across if finding.episode == EVERY_EPISODE}
    with np.errstate(all="ignore"):
        usual = usual_spreads([values for _, _, values in episodes], channels)
    alone = [finding for episode in episodes for finding in check_episode(*episode, channels, usual)]
    return [finding for finding in alone if (finding.channel, finding.kind) not in known] + across


def check_episode(
    name: str,
    times: Float[np.ndarray, " T"],
    values: Float[np.ndarray, "T D"],
    channels: Sequence[Channel],
    usual: Mapping[str, float] | None = None,
) -> list[Finding]:
    """What is wrong with one episode: times (T,) [s], values (T, D) as they stand in the file, D channels.

    `usual` is how far each group of channels moves in the other episodes, by which jumps are judged where it is known.
    Raises DataError where the shapes do not fit.
    """
    check_shape(name, times, values, channels)
    with np.errstate(all="ignore"):  # the numbers may be anything
        return [
            *check_clock(name, times),
            *check_values(name, times, values, channels),
            *check_quaternions(name, times, values, channels),
            *check_jumps(name, times, values, channels, usual),
        ]
