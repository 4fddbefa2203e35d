"""A run as it can be told: what was seen, what was believed of it at every step, and what truly happened."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from inphase.arrays import freeze
from inphase.channels import Role
from inphase.errors import DataError
from inphase.model import Model
from inphase.recording import Recording
from inphase.replay import identical, provenance_of, session_of, steps
from inphase.report.glimpse import Glimpse, Lens
from inphase.report.steady import beside
from inphase.result import Estimate, Response
from inphase.session import Session
from inphase.trajectory import Demonstration

FRAMES = 1200  # at most: steps whose response and belief are kept
SAMPLES = 25  # of a response
Told = Callable[[float], None]  # the share that is done


@dataclass(frozen=True, eq=False)
class Frame:
    """A step that is told in full. step: which. response: the rest of the movement, as foreseen then."""

    step: int
    response: Response | None
    glimpse: Glimpse | None


@dataclass(frozen=True, eq=False)
class Account:
    """A run with its beliefs.

    recording: what was seen, with an estimate of every step. names: (Dc,) the controlled channels. now: (T, Dc) and
    now_std: what the response said they should read, at now_times (T,) [s]; NaN where none was asked for. truth:
    (T, Dc) what they truly read at the steps' times, NaN where that is not known. progress: (T,) the share of the
    whole interaction that had passed, where it is known how it ended; empty otherwise. frames: some of the steps, in
    order. lens: whence the beliefs are seen. remarks: what the page cannot tell, and why.
    """

    title: str
    recording: Recording
    model: Model | None
    names: tuple[str, ...]
    now_times: Float[np.ndarray, " T"]
    now: Float[np.ndarray, "T Dc"]
    now_std: Float[np.ndarray, "T Dc"]
    truth: Float[np.ndarray, "T Dc"]
    frames: tuple[Frame, ...]
    progress: Float[np.ndarray, " P"] = field(default_factory=lambda: np.empty(0))
    lens: Lens | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(
            self,
            now_times=self.now_times,
            now=self.now,
            now_std=self.now_std,
            truth=self.truth,
            progress=self.progress,
        )

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """One a step."""
        return self.recording.estimates

    @property
    def times(self) -> Float[np.ndarray, " T"]:
        """(T,) [s] of the steps."""
        return np.array([estimate.time for estimate in self.estimates])

    @property
    def begin(self) -> float:
        """The time that is called 0 [s]."""
        return float(self.recording.times[0]) if len(self.recording.times) else 0.0


def account_of_demonstration(
    model: Model,
    demonstration: Demonstration,
    filter: str | None = None,
    seed: int = 0,
    *,
    title: str | None = None,
    told: Told | None = None,
    **options: object,
) -> Account:
    """The account of a demonstration that is played to a session, which is shown the observed channels alone.

    demonstration: columns as in `model.names`. Raises OptionError for a filter or option that is none.
    """
    count = len(model.observed)
    given = np.array(demonstration.values)
    given[:, count:] = np.nan
    provenance = provenance_of(model, filter, seed, options)
    recording = Recording(demonstration.name, model.channels, demonstration.times, given, (), (), provenance)
    account = _played(recording, model, title or demonstration.name, told)
    truth = beside(model.channels[count:], demonstration.values[:, count:], account.now)
    return replace(account, truth=truth, progress=demonstration.phases)


def account_of_recording(
    recording: Recording, model: Model | None = None, *, title: str | None = None, told: Told | None = None
) -> Account:
    """The account of a recorded run: with a model it is played again, for what it believed; without, as recorded.

    Where the model is not that of the recording, or its estimates do not come out again, the account says so.
    """
    title = title or recording.name
    if model is None:
        return _as_recorded(recording, None, title, "the recording holds no model: its beliefs cannot be shown")
    try:
        session_of(recording, model)
    except DataError as error:
        return _as_recorded(recording, None, title, f"its beliefs cannot be shown: {error}")
    if not len(recording.times):
        return _as_recorded(recording, model, title, "nothing was observed in it")
    account = _played(recording, model, title, told)
    made, recorded = account.estimates, recording.estimates
    differ = sum(not identical(one, other) for one, other in zip(made, recorded, strict=False))
    if len(made) != len(recorded) or differ:
        account = replace(
            account,
            remarks=(
                *account.remarks,
                f"{differ + abs(len(made) - len(recorded))} of {len(recorded)} estimates do not come out again as they "
                "were recorded, as where samples were lost: what is shown is what was computed again",
            ),
        )
    return account


def _played(recording: Recording, model: Model, title: str, told: Told | None) -> Account:
    """Every sample once more: estimates, responses now, and beliefs at the frames."""
    lens = Lens.of(model)
    count = len(recording.times)
    wanted = set(frame_steps(count).tolist())
    known = recording.responses if len(recording.responses) == count else (None,) * count
    estimates, responses, frames = list[Estimate](), list[Response | None](), list[Frame]()
    for i, (session, estimate) in enumerate(_told(steps(recording, session_of(recording, model)), count, told)):
        whole = session.respond(samples=SAMPLES) if i in wanted else None
        estimates.append(estimate)
        responses.append(known[i] or whole or session.respond(samples=1))
        if whole is not None:
            frames.append(Frame(i, whole, lens.look(session.belief)))
    made = replace(recording, estimates=tuple(estimates), responses=tuple(responses))
    return _account(made, model, title, tuple(frames), lens)


def _as_recorded(recording: Recording, model: Model | None, title: str, remark: str) -> Account:
    wanted = frame_steps(len(recording.estimates)).tolist()
    frames = tuple(Frame(step, recording.responses[step], None) for step in wanted)
    return replace(_account(recording, model, title, frames, None), remarks=(remark,))


def _account(
    recording: Recording, model: Model | None, title: str, frames: tuple[Frame, ...], lens: Lens | None
) -> Account:
    controlled = [channel for channel in recording.channels if channel.role is Role.CONTROLLED]
    names = tuple(channel.name for channel in controlled)
    steps = len(recording.estimates)
    now_times = np.array([estimate.time for estimate in recording.estimates])
    now, now_std = np.full((steps, len(names)), np.nan), np.full((steps, len(names)), np.nan)
    columns = {name: i for i, name in enumerate(names)}
    for i, response in enumerate(recording.responses):
        if response is None or not len(response):
            continue
        own = [k for k, name in enumerate(response.channels) if name in columns]
        at = [columns[response.channels[k]] for k in own]
        now_times[i], now[i, at], now_std[i, at] = response.times[0], response.mean[0, own], response.std[0, own]
    truth = beside(controlled, _read(recording, names), now)
    return Account(title, recording, model, names, now_times, now, now_std, truth, frames, lens=lens)


def _read(recording: Recording, names: tuple[str, ...]) -> Float[np.ndarray, "T Dc"]:
    """What the controlled channels were seen to read, at the steps' times."""
    times = np.array([estimate.time for estimate in recording.estimates])
    truth = np.full((len(times), len(names)), np.nan)
    for k, name in enumerate(names):
        column = next(i for i, channel in enumerate(recording.channels) if channel.name == name)
        seen: Bool[np.ndarray, " T"] = np.isfinite(recording.values[:, column])
        if seen.any() and len(times):
            read = recording.times[seen]
            within = (times >= read[0]) & (times <= read[-1])
            truth[within, k] = np.interp(times[within], read, recording.values[seen, column])
    return truth


def frame_steps(count: int) -> np.ndarray:
    """Which of that many steps are told in full: all, or evenly many with the first and the last."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, FRAMES)).round().astype(np.int64))


def _told(
    played: Iterator[tuple[Session, Estimate]], count: int, told: Told | None
) -> Iterator[tuple[Session, Estimate]]:
    for i, step in enumerate(played):
        if told is not None and i % 20 == 0:
            told(i / count)
        yield step
