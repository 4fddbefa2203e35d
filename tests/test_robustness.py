"""What happens outside a laboratory: waiting, pauses, another speed, a lost sensor, wild readings, someone else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from interactions import NOISE_STD, curves, dataset, shapes_unchecked, taught

import inphase
from inphase.errors import OptionError
from inphase.filters import FILTERS
from inphase.result import Status

NAMES = pytest.mark.parametrize("name", sorted(FILTERS))
SEEDS = pytest.mark.parametrize("seed", range(3))
RATE = 25.0  # [Hz]
COUNT = 50  # samples of an interaction as it was demonstrated, and the first


@pytest.fixture(scope="module")
def model() -> inphase.Model:
    return taught(dataset(np.random.default_rng(7), count=16, rate=RATE))


def partner(phases: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What a partner with a style of their own reads at these phases (T,), and where the robot should be: (T, 2)."""
    rng = np.random.default_rng(seed)
    clean = curves(phases, rng.standard_normal(2))
    return clean[:, :2] + NOISE_STD * rng.standard_normal((len(phases), 2)), clean[:, 2:]


@dataclass(frozen=True)
class Played:
    """What was answered at every sample: all (T,), but mean and std (T, 2) of the response now."""

    phase: np.ndarray
    tempo: np.ndarray  # over the demonstrated one
    status: list[Status]
    mean: np.ndarray
    std: np.ndarray


def play(model: inphase.Model, samples: np.ndarray, seed: int, name: str | None = None) -> Played:
    session, estimates, responses = model.session(name, seed=seed), [], []
    for i, sample in enumerate(samples):
        estimates.append(session.observe(i / RATE, sample))
        responses.append(session.respond(samples=1))
    return Played(
        phase=np.array([e.phase for e in estimates]),
        tempo=np.array([e.phase_velocity for e in estimates]) / model.phase.nominal_velocity,
        status=[e.status for e in estimates],
        mean=np.array([r.mean[0] for r in responses]),
        std=np.array([r.std[0] for r in responses]),
    )


def by_the_clock(model: inphase.Model, count: int) -> np.ndarray:
    """(T, 2) what playing the mean of the demonstrations in their tempo would answer, whatever the partner does."""
    return model.predict(np.minimum(np.arange(count) / RATE * model.phase.nominal_velocity, 1.0))[:, 2:]


def against_the_clock(model: inphase.Model, played: Played, truth: np.ndarray) -> float:
    """The error of the response, over that of playing by the clock."""
    clock = np.abs(by_the_clock(model, len(truth)) - truth).mean()
    return float(np.abs(played.mean - truth).mean() / clock)


# ----------------------------------------------------------------------------------------------------------- tempo


@SEEDS
def test_a_partner_may_wait_before_beginning(seed: int, model: inphase.Model) -> None:
    waits, moves = COUNT // 2, np.linspace(0, 1, COUNT + 1)
    samples, truth = partner(np.concatenate([np.zeros(waits), moves]), seed)
    samples[:waits] = samples[0]  # the very same reading, as a sensor gives that sends its last one again
    played = play(model, samples, seed)
    assert played.phase[:waits].max() < 0.05
    assert np.abs(played.phase[waits:] - moves).max() < 0.1
    assert played.status[-1] is Status.FINISHED
    assert {*played.status} == {Status.FOLLOWING, Status.FINISHED}
    assert against_the_clock(model, played, truth) < 0.2


@SEEDS
def test_a_partner_may_pause_and_go_on(seed: int, model: inphase.Model) -> None:
    before, still = np.arange(20), np.full(40, 20)
    phases = np.concatenate([before, still, np.arange(20, COUNT + 1)]) / COUNT
    samples, _ = partner(phases, seed)
    played = play(model, samples, seed)
    assert played.tempo[10:20].mean() > 0.8
    assert played.tempo[30:60].max() < 0.3
    assert played.tempo[65:75].mean() > 0.8
    assert np.ptp(played.phase[30:60]) < 0.05
    assert np.abs(played.phase - phases).max() < 0.1


def test_a_partner_who_pauses_is_answered_far_better_than_by_the_clock(model: inphase.Model) -> None:
    phases = np.concatenate([np.arange(20), np.full(40, 20), np.arange(20, COUNT + 1)]) / COUNT
    shares = []
    for seed in range(8):  # how well one of them is answered hangs on where the filter believes the pause
        samples, truth = partner(phases, seed)
        shares.append(against_the_clock(model, play(model, samples, seed), truth))
    assert np.mean(shares) < 0.2


@SEEDS
@pytest.mark.parametrize("tempo", [0.5, 2.0])
def test_a_partner_may_be_half_or_twice_as_fast(tempo: float, seed: int, model: inphase.Model) -> None:
    phases = np.linspace(0, 1, round(COUNT / tempo) + 1)
    samples, truth = partner(phases, seed)
    played = play(model, samples, seed)
    assert played.phase[-1] > 0.95
    assert np.abs(played.phase - phases).max() < 0.1
    assert played.tempo[len(phases) // 2] == pytest.approx(tempo, rel=0.2)
    assert against_the_clock(model, played, truth) < 0.15


def test_a_rest_that_is_cut_short_is_leapt_over() -> None:
    """The demonstrated movement rests from 0.45 to 0.65, where nothing tells the phase; a partner goes on at once."""

    def resting(phases: np.ndarray) -> np.ndarray:
        return np.interp(phases, [0.0, 0.45, 0.65, 1.0], [0.0, 0.5, 0.5, 1.0])

    rng, moments = np.random.default_rng(7), np.linspace(0, 1, COUNT + 1)
    values = [curves(resting(moments), rng.standard_normal(2)) for _ in range(16)]
    values = [v + NOISE_STD * rng.standard_normal(v.shape) for v in values]
    data = inphase.Dataset.from_arrays([np.arange(COUNT + 1) / RATE] * 16, values, ["a", "b"], ["c", "d"])
    model = inphase.fit(data, calibrate=False)
    without = replace(model, tempo=replace(model.tempo, leap_rate=0.0))
    phases = np.concatenate([moments[moments < 0.46], moments[moments > 0.64]])
    off = []
    for seed in range(4):
        samples, _ = partner(resting(phases), seed)
        played = [np.abs(play(one, samples, seed).phase - phases) for one in (model, without)]
        off.append([one[(phases > 0.75) & (phases < 0.95)].mean() for one in played])
    leapt, lost = np.mean(off, axis=0)
    assert leapt < 0.08
    assert leapt < lost / 2


# --------------------------------------------------------------------------------------------------------- readings


@pytest.mark.parametrize(("name", "seed"), [*[(name, 0) for name in sorted(FILTERS)], ("rbpf", 1)])
def test_a_lost_sensor_widens_the_prediction_which_then_recovers(name: str, seed: int, model: inphase.Model) -> None:
    begins, ends = 17, 32  # 30 %
    samples, truth = partner(np.arange(COUNT + 1) / COUNT, seed)
    seen = play(model, samples, seed, name)
    samples[begins:ends] = np.nan
    played = play(model, samples, seed, name)
    off, plain_off = np.abs(played.mean - truth), np.abs(seen.mean - truth)
    wider = (played.std / seen.std).mean(1)  # where a movement is uncertain anyway is no matter
    assert (wider[:begins] == 1).all()
    assert wider[ends - 1] > max(1.25, wider[ends - 8], wider[begins])
    assert (off[begins:ends] < 4 * played.std[begins:ends]).all()
    after = slice(ends + 5, None)
    assert wider[after].mean() < 1.25
    assert off[after].max() < plain_off[after].max() + 0.02
    if name == "rbpf":
        assert wider[ends - 1] > 3
        assert off[after].max() < 0.05


@NAMES
def test_a_wild_sample_outside_the_gate_is_as_good_as_none(name: str, model: inphase.Model) -> None:
    samples, _ = partner(np.arange(26) / COUNT, 0)
    missed, wild = samples.copy(), samples.copy()
    missed[20] = np.nan
    wild[20] += 3.5 * model.scaling.span[:2]
    one, other = play(model, missed, 0, name), play(model, wild, 0, name)
    np.testing.assert_array_equal(one.mean, other.mean)
    np.testing.assert_array_equal(one.phase, other.phase)
    assert other.status[20] is Status.REFUSED
    assert one.status[21:] == other.status[21:]


@pytest.mark.parametrize(
    ("size", "channels"), [(0.5, [0]), (-0.5, [1]), (1.5, [1]), (-1.5, [0]), (0.5, [0, 1]), (1.5, [0, 1])]
)
def test_one_wild_reading_moves_the_response_by_less_than_its_band(
    size: float, channels: list[int], model: inphase.Model
) -> None:
    """Inside the gate, by half a range and more, in one channel or in both."""
    samples, _ = partner(np.arange(COUNT + 1) / COUNT, 0)
    plain = play(model, samples, 0)
    samples[20, channels] += size * model.scaling.span[channels]
    struck = play(model, samples, 0)
    assert (np.abs(struck.mean - plain.mean) < plain.std).all()
    assert (np.abs(struck.mean - plain.mean)[-10:] < 0.5 * plain.std[-10:]).all()
    assert np.abs(struck.phase - plain.phase).max() < 0.03
    assert struck.status[21:] == plain.status[21:]
    assert struck.status[20] is (Status.REFUSED if len(channels) == 2 else Status.FOLLOWING)


@NAMES
def test_one_wild_reading_derails_no_filter(name: str, model: inphase.Model) -> None:
    samples, truth = partner(np.arange(COUNT + 1) / COUNT, 1)
    plain = play(model, samples, 1, name)
    samples[20] += 0.5 * model.scaling.span[:2]
    struck = play(model, samples, 1, name)
    off, plain_off = np.abs(struck.mean - truth).mean(), np.abs(plain.mean - truth).mean()
    assert off < 1.2 * plain_off + 0.005


@pytest.mark.parametrize("seed", range(2))
def test_a_partner_who_jumps_is_heard_as_soon_as_it_is_no_slip(seed: int, model: inphase.Model) -> None:
    samples, _ = partner(np.arange(COUNT + 1) / COUNT, seed)
    samples[20:] += 0.5 * model.scaling.span[:2]
    status = play(model, samples, seed).status
    assert {*status[20:22]} == {Status.REFUSED}
    assert Status.REFUSED not in status[22:30]
    assert Status.UNLIKE in status[22:25]


def test_who_wants_it_has_every_reading_taken_at_its_word(model: inphase.Model) -> None:
    samples, _ = partner(np.arange(COUNT + 1) / COUNT, 1)
    samples[20] += 0.5 * model.scaling.span[:2]
    wary, plain = model.session("bip", slips=True), model.session("bip", slips=False)
    for i, sample in enumerate(samples[:21]):
        heard = [session.observe(i / COUNT, sample) for session in (wary, plain)]
        assert (heard[0] == heard[1]) == (i < 20)
    assert [estimate.status is Status.REFUSED for estimate in heard] == [True, False]
    with shapes_unchecked(), pytest.raises(OptionError, match="slips: expected true or false, got 'no'"):
        model.session(slips="no")  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------ someone else


@NAMES
@pytest.mark.parametrize("what", ["turns back", "takes another way"])
def test_a_partner_who_does_something_else_is_told_soon(name: str, what: str, model: inphase.Model) -> None:
    leaves, seed = 25, 1
    phases = np.arange(COUNT + 1) / COUNT
    if what == "turns back":
        phases[leaves:] = phases[leaves] - phases[: COUNT + 1 - leaves]
    samples, _ = partner(phases, seed)
    if what == "takes another way":
        samples[leaves:, 1] += 0.5 * np.sin(np.linspace(0, np.pi, COUNT + 1 - leaves))
    status = play(model, samples, seed, name).status
    soon = {"rbpf": 5, "promp": 15}.get(name, 6)  # samples; an alignment may always mean that the partner waits
    assert {*status[: leaves + 1]} == {Status.FOLLOWING}
    assert status.index(Status.UNLIKE) <= leaves + soon
    assert not Status.UNLIKE.trustworthy
    if name == "rbpf":
        assert {*status[leaves + soon :]} == {Status.UNLIKE}
