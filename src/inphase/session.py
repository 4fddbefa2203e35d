"""A live interaction: samples go in one at a time, estimates and responses come out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from inphase.active import open_at
from inphase.arrays import frozen
from inphase.channels import match
from inphase.errors import ObservationError, OptionError, listing
from inphase.filters import RECOMMENDED, Belief, Course, StepInfo, make
from inphase.model import Model
from inphase.observation import NOTHING, Observation
from inphase.reflex import Memory
from inphase.result import Estimate, Response, Status

FAR = 2.0  # ranges beyond all that was demonstrated: no reading of this partner
BLIND_AFTER = 0.1  # of a typical interaction with nothing seen, and the estimate is called blind
UNLIKE_ABOVE = 4.0  # squared distance of a reading from what is believed of it, in its variance, averaged; usually ≤ 1
UNLIKE_WITHIN = 0.05  # of a typical interaction, the time constant of that average
SURPRISING = 25.0  # squared distance of a reading from what is foreseen of it, in its variance
SLIP = 0.03  # of a typical interaction: a surprise that is over sooner is a slip of the sensor
NEXT_SLIP = 0.2  # of a typical interaction after which the next surprise may be one again
NOW = Course(np.ones(1), np.zeros(1))
FINISHED_AT, AGAIN_BELOW = 0.99, 0.95  # phases where the end is told and taken back: no flicker in between
SLOWEST = 0.05  # of the typical tempo: a response to a partner who stands still must end some time


class Session:
    """One interaction, followed live: `observe` every sample, `respond` whenever a response is wanted.

    Time is an argument and randomness comes from the seed, so that the same samples give the same answers, bit for
    bit. Mistakes raise; trouble is told by the status of the estimate.
    """

    def __init__(
        self, model: Model, filter: str | None = None, seed: int = 0, *, slips: bool = True, **options: Any
    ) -> None:
        if not isinstance(slips, bool):  # a text of a configuration would be true, whatever it says
            raise OptionError(f"slips: expected true or false, got {slips!r}")
        self.model = model
        self._wary = slips
        self._filter = make(RECOMMENDED if filter is None else filter, model, **options)
        self._seed = seed
        self._index = {name: i for i, name in enumerate(model.names)}
        self._typical_duration = 1.0 / model.phase.nominal_velocity
        self._shown = np.arange(model.observed_features)
        self._answered = self._columns(model.controlled)
        self.reset()
        self._warm_up()

    def __repr__(self) -> str:
        return f"Session({self._filter.__class__.__name__.lower()} of {self.model!r}, time={self._time})"

    def reset(self, seed: int | None = None) -> None:
        """Begin a new interaction, with a new seed or the same again."""
        self._seed = self._seed if seed is None else seed
        self._rng = np.random.default_rng(self._seed)
        self._belief: Belief = self._filter.init(self._rng)
        self._time: float | None = None
        self._last_seen = np.full(self.model.coordinates.count, -np.inf)
        self._last_sight: float | None = None
        self._surprised = np.full(self.model.coordinates.count, -np.inf)
        self._memory = Memory.empty(len(self._shown))
        self._misfit = 1.0
        self._finished = False
        self._refused = False

    def _warm_up(self) -> None:
        """Do what is done once, so that the first sample of a partner need not wait for it."""
        begun = self.model.predict(self.model.phase.confine(self.model.phase.mean[:1]))[0, : len(self.model.observed)]
        for time in (0.0, 0.01 * self._typical_duration):
            self.observe(time, begun)
            self.respond(samples=2)
        self.reset()

    @property
    def belief(self) -> Belief:
        """The distribution over phase and weights after the last sample."""
        return self._belief

    @property
    def time(self) -> float | None:
        """The time of the last sample [s]; None before the first."""
        return self._time

    def observe(self, time: float, values: ArrayLike | Mapping[str, float]) -> Estimate:
        """Take in one sample and say where the interaction is.

        time: [s], never earlier than the last. values: the observed channels in their order, or {name: value} of any
        channels, controlled ones too; what is NaN, infinite or left out was not seen, nor was a channel whose
        `model.active` window does not hold the phase foreseen for this time, and a sample in which nothing
        was seen is a prediction alone. So is one that lies more than two ranges outside all demonstrations
        (Status.REFUSED). Raises ObservationError for a time that runs backwards, a wrong number of
        values or an unknown name.
        """
        time = float(_number(time, "time"))
        if not np.isfinite(time) or (self._time is not None and time < self._time):
            expected = "a finite time" if self._time is None else f"a time of at least {self._time:g} s"
            raise ObservationError(f"expected {expected}, got {time:g} s; reset() begins a new interaction")
        sample = self._sample(values)
        dt = 0.0 if self._time is None else time - self._time
        observation = self._observation(sample, time, dt)
        belief, info = self._filter.step(self._belief, observation, dt, self._rng)
        used = observation if info.healthy else NOTHING
        self._belief, self._time = belief, time
        self._last_seen[used.features] = time
        self._remember(used)
        if self._last_sight is None or len(used):
            self._last_sight = time
        return self._estimate(used, info, dt)

    def respond(
        self,
        lookahead: float = 0.0,
        samples: int = 50,
        *,
        start: float | None = None,
        channels: Sequence[str] | str | None = None,
    ) -> Response:
        """What the controlled channels should read from now to the end of the interaction.

        lookahead: begin that much phase later than the estimate (4.2.8.3). start: begin at that phase instead
        (4.2.8.2). samples: how many, evenly spaced in phase; 1 is the first alone. channels: names or patterns of
        others to tell of, the partner's included. A periodic interaction is answered for one cycle. `std` is that of
        a reading: doubt about phase and weights, and the observation noise. Raises OptionError, ChannelError.
        """
        course = self._course(lookahead, start, samples)
        model = self.model
        columns, features = self._answered if channels is None else self._columns(channels)
        mean, var = np.zeros((samples, model.coordinates.count)), np.zeros((samples, model.coordinates.count))
        phase, velocity = self._belief.phase_mean[0], self._velocity()[0]
        phases = course.share * phase + course.offset
        phases = phases if model.phase.periodic else np.minimum(np.maximum(phases, 0.0), 1.0)
        ahead = phases - phase
        if model.phase.periodic:
            ahead += max(np.ceil(phase - phases[0]), 0.0)  # a phase that has passed comes again in the next cycle
        duration = ahead / max(velocity, SLOWEST * model.phase.nominal_velocity)
        mean[:, features], var[:, features] = self._belief.trajectory(course, features)
        var[:, features] += model.noise.var[features]
        self._reflect(course, duration, features, mean, var)
        mean, var = model.to_channels(mean, model.band**2 * var)
        return Response(
            times=(self._time or 0.0) + duration,
            phases=phases % 1.0 if model.phase.periodic else phases,
            mean=mean[:, columns],
            std=np.sqrt(var[:, columns]),
            channels=tuple([model.names[i] for i in columns]),
        )

    def _sample(self, values: ArrayLike | Mapping[str, float]) -> Float[np.ndarray, " D"]:
        """All channels, NaN where not seen."""
        sample = np.full(len(self.model.channels), np.nan)
        if isinstance(values, Mapping):
            for name, value in values.items():
                if name not in self._index:
                    raise ObservationError(f"unknown channel {name!r}; the channels are {listing(self._index)}")
                sample[self._index[name]] = _number(value, name)
        else:
            observed = self.model.observed
            array = _numbers(values, observed)
            if array.shape != (len(observed),):
                raise ObservationError(
                    f"expected {len(observed)} values, one for each of {listing(observed)}, got shape {array.shape}"
                )
            sample[: len(observed)] = array
        sample[np.isinf(sample)] = np.nan
        return sample

    def _observation(self, sample: Float[np.ndarray, " D"], time: float, dt: float) -> Observation:
        model = self.model
        if model.coordinates.flat:
            values = sample
        else:
            # Angles and rotations are read on the branch that lies nearest to what is expected of them.
            near = model.scaling.unscale(model.layout.predict(self._foreseen(dt), self._belief.weights_mean)[0])
            values = model.coordinates.sample(sample, near)
        if not model.always_active:  # what reads outside of its window is not seen
            phase = float(self._foreseen(dt)[0])
            values = np.where(open_at(model.active, phase % 1.0 if model.phase.periodic else phase), values, np.nan)
        noise_var = model.noise.at(time - self._last_seen)
        scaled = model.scaling.scale(values)
        # One reading in the wrong unit would move the belief for good. The gate is one of values, not of surprise: a
        # filter that is lost has to hear what surprises it.
        near = np.abs(scaled - 0.5) <= 0.5 + FAR  # NaN is not near
        self._refused = bool((np.isfinite(scaled) & ~near).any())
        seen = np.flatnonzero(near & np.isfinite(noise_var))
        slips = self._slips(seen, scaled[seen], time, dt)
        self._refused |= bool(slips.any())
        seen = seen[~slips]
        return Observation(seen, scaled[seen], noise_var[seen])

    def _foreseen(self, dt: float) -> Float[np.ndarray, " 1"]:
        """(1,) the phase that is expected dt [s] after the last sample."""
        return self.model.phase.confine(self._belief.phase_mean[:1] + self._velocity()[0] * dt)

    def _slips(
        self, features: Int[np.ndarray, " M"], values: Float[np.ndarray, " M"], time: float, dt: float
    ) -> Bool[np.ndarray, " M"]:
        """Readings to wait with: who surprises for a moment is the sensor, who goes on surprising is the partner."""
        if len(features) == 0 or not self._wary:
            return np.zeros(len(features), dtype=bool)
        ahead = Course(np.ones(1), np.array([self._velocity()[0] * dt]))
        surprising = self._distances(ahead, features, values) > SURPRISING
        begins = surprising & (time - self._surprised[features] > NEXT_SLIP * self._typical_duration)
        self._surprised[features[begins]] = time
        return np.asarray(surprising & (time - self._surprised[features] < SLIP * self._typical_duration))

    def _remember(self, used: Observation) -> None:
        reflex, shown = self.model.reflex, used.features < len(self._shown)
        if reflex is not None and shown.any() and self._time is not None:
            seen, values = used.features[shown], used.values[shown]
            self._memory = self._memory.after(self._time, seen, values, reflex.memory)

    def _reflect(
        self,
        course: Course,
        ahead: Float[np.ndarray, " S"],
        features: Int[np.ndarray, " M"],
        mean: Float[np.ndarray, "S F"],
        var: Float[np.ndarray, "S F"],
    ) -> None:
        """Let the reflex have its share of a response: by its precision now, less and less the further ahead.

        What has not been seen for a while, or is seen itself, it leaves alone.
        """
        reflex, memory, noise = self.model.reflex, self._memory, self.model.noise
        if reflex is None or reflex.weight == 0 or self._time is None or not len(memory.times):
            return
        last = memory.times[-1]
        ago, seen = self._time - last, last - memory.last_seen <= reflex.memory
        own = features[(features >= len(self._shown)) & (self._time - self._last_seen[features] > reflex.memory)]
        if not len(own):
            return
        tempo = self._velocity()[0]
        moments = memory.at(last - reflex.lags)
        if not seen.all():  # what is out of sight stands where the filter believes
            before = Course(np.ones(len(reflex.lags)), -tempo * (ago + reflex.lags))
            moments[:, ~seen] = self._belief.trajectory(before, self._shown[~seen])[0]
        answer, error_var = (part[own - len(self._shown)] for part in reflex.answer(moments))
        if ago == 0 and (course.share[0], course.offset[0]) == (1.0, 0.0):  # the response begins where it was seen
            then, then_var = mean[0, own], var[0, own]
        else:
            at_last = Course(np.ones(1), np.array([-tempo * ago]))
            then, then_var = (part[0] for part in self._belief.trajectory(at_last, own))
            then_var = then_var + noise.var[own]
        weighted = reflex.weight * seen.mean() * then_var
        lasting = np.maximum(noise.correlation_time[own], np.finfo(float).tiny)
        lost = np.exp(-ago / reflex.fade - np.abs(ahead)[:, None] / lasting)
        share = lost * weighted / (weighted + error_var)
        # The variance of a mixture of both: their errors have much in common, and where they disagree, who knows?
        var[:, own] += share * (error_var - var[:, own]) + share * (1 - share) * (answer - then) ** 2
        mean[:, own] += share * (answer - then)

    def _columns(self, channels: Sequence[str] | str) -> tuple[list[int], Int[np.ndarray, " M"]]:
        columns = match(channels, self.model.names)
        return columns, self.model.coordinates.features_of(columns)

    def _course(self, lookahead: float, start: float | None, samples: int) -> Course:
        if not (isinstance(samples, (int, np.integer)) and samples >= 1):
            raise OptionError(f"expected samples to be a whole number of at least 1, got {samples!r}")
        if not 0 <= lookahead <= 1:
            raise OptionError(f"expected a lookahead of phase between 0 and 1, got {lookahead}")
        if start is not None and not 0 <= start <= 1:
            raise OptionError(f"expected a start phase between 0 and 1, got {start}")
        if start is not None and lookahead != 0:
            raise OptionError(f"give either start or lookahead, got start={start} and lookahead={lookahead}")
        steps = _steps(int(samples))
        if self.model.phase.periodic:
            return Course(np.full(samples, float(start is None)), (start or lookahead) + steps)
        if start is not None:
            return Course(np.zeros(samples), start + (1 - start) * steps)
        return Course(1 - steps, (1 - steps) * lookahead + steps)

    def _velocity(self) -> tuple[float, float]:
        """Tempo and its standard deviation [1/s]; a phase model without one has that of the demonstrations."""
        mean, cov = self._belief.phase_mean, self._belief.phase_cov
        if len(mean) == 1:
            return self.model.phase.nominal_velocity, 0.0
        return float(mean[1]), float(np.sqrt(max(cov[1, 1], 0.0)))

    def _estimate(self, observation: Observation, info: StepInfo, dt: float) -> Estimate:
        model, belief = self.model, self._belief
        phase, var = float(belief.phase_mean[0]), float(belief.phase_cov[0, 0])
        velocity, velocity_std = self._velocity()
        if len(observation):
            keep = np.exp(-dt / (UNLIKE_WITHIN * self._typical_duration))
            # Not the filter's surprise: correlated noise makes each of many readings count for little there, and a
            # partner who does something else for a whole interaction surprises no sample in particular.
            distance = float(self._distances(NOW, observation.features, observation.values).mean())
            self._misfit = keep * self._misfit + (1 - keep) * distance
        span = model.scaling.span[observation.features]
        return Estimate(
            time=self._time or 0.0,
            # A mean of particles that all stand at 1 may round to more.
            phase=phase % 1.0 if model.phase.periodic else min(max(phase, 0.0), 1.0),
            phase_std=float(np.sqrt(max(var, 0.0))),
            phase_velocity=velocity,
            phase_velocity_std=velocity_std,
            log_likelihood=info.log_likelihood - float(np.log(span).sum()) if len(observation) else 0.0,
            status=self._status(observation, info, phase),
        )

    def _distances(
        self, course: Course, features: Int[np.ndarray, " M"], values: Float[np.ndarray, " M"]
    ) -> Float[np.ndarray, " M"]:
        """How far readings lie from what is believed of them there, squared, in units of their variance."""
        mean, var = self._belief.trajectory(course, features)
        return np.asarray((values - mean[0]) ** 2 / (var[0] + self.model.noise.var[features]))

    def _status(self, observation: Observation, info: StepInfo, phase: float) -> Status:
        if not info.healthy:
            return Status.COLLAPSED
        if len(observation) == 0:
            unseen = (self._time or 0.0) - (self._last_sight or 0.0)
            for_long = unseen > BLIND_AFTER * self._typical_duration
            if self._refused:
                return Status.UNLIKE if for_long or self._misfit > UNLIKE_ABOVE else Status.REFUSED
            return Status.BLIND if for_long else Status.NOTHING_SEEN
        if self._misfit > UNLIKE_ABOVE:
            return Status.UNLIKE
        self._finished = phase >= (AGAIN_BELOW if self._finished else FINISHED_AT) and not self.model.phase.periodic
        return Status.FINISHED if self._finished else Status.FOLLOWING


@lru_cache(maxsize=16)
def _steps(samples: int) -> Float[np.ndarray, " S"]:
    return frozen(np.linspace(0.0, 1.0, samples))


def _number(value: object, name: str) -> float:
    array = _numbers(value, [name])
    if array.ndim:
        raise ObservationError(f"expected one number for {name}, got {value!r}")
    return float(array)


def _numbers(values: object, names: Sequence[str]) -> Float[np.ndarray, ...]:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ObservationError(f"expected numbers for {listing(names)}, got {values!r}") from None
