"""What a page knows of a run: names and sentences as JSON, numbers packed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from inphase.channels import Channel, Role
from inphase.recording import Recording
from inphase.report.account import Account
from inphase.report.findings import find
from inphase.report.page.packing import Packing
from inphase.report.spells import events_of, pauses_of, status_spells
from inphase.report.steady import steady
from inphase.report.summary import summarise
from inphase.result import Status

MOST_NUMBERS = 2_500_000  # of readings of one run: 5 MB, of which a text makes 6.7
MOST_CONTROLLED = 24  # channels whose responses are told
CORRELATED = 14  # channels at most, in the table of correlations


def payload(account: Account, most_numbers: int = MOST_NUMBERS) -> tuple[dict[str, Any], str]:
    """The run's description, and its numbers in base64."""
    packing, recording = Packing(), account.recording
    shown = _shown(recording, Role.OBSERVED, most_numbers // max(len(recording.times), 1))
    answered = _shown(recording, Role.CONTROLLED, MOST_CONTROLLED)
    own = [account.names.index(recording.channels[column].name) for column in answered]
    begin = account.begin
    packing.put("sample_times", recording.times - begin)
    packing.put_quantised("observed", steady(recording.channels, recording.values)[:, shown])
    _pack_steps(packing, account, own)
    _pack_commands(packing, account, own)
    _pack_frames(packing, account, own)
    correlated = _pack_belief(packing, account)
    description = {
        "title": account.title,
        "filter": recording.provenance.get("filter", ""),
        "length": float(recording.times[-1] - begin) if len(recording.times) else 0.0,
        "steps": len(account.estimates),
        "typical": account.model.phase.nominal_velocity if account.model else None,
        "observed": [_told(recording.channels[column]) for column in shown],
        "controlled": [_told(recording.channels[column]) for column in answered],
        "left_out": {
            "observed": _count(recording, Role.OBSERVED) - len(shown),
            "controlled": len(account.names) - len(answered),
        },
        "correlated": correlated,
        "statuses": [{"name": status.name, "says": status.value, "fine": status.trustworthy} for status in Status],
        "spells": [spell.plain(begin) for spell in status_spells(account)],
        "pauses": [[start - begin, end - begin] for start, end in pauses_of(account)],
        "events": events_of(account),
        "findings": [finding.plain for finding in find(account)],
        "remarks": list(account.remarks),
        "summary": summarise(account),
        "arrays": packing.contents,
    }
    return description, packing.text


def as_script(value: object) -> str:
    """JSON that may stand in a page, whatever it holds."""
    text = json.dumps(_finite(value), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _finite(value: Any) -> Any:
    """The same without NaN and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def _told(channel: Channel) -> dict[str, str]:
    return {"name": channel.name, "unit": channel.unit, "group": channel.group, "kind": channel.kind.value}


def _count(recording: Recording, role: Role) -> int:
    return sum(channel.role is role for channel in recording.channels)


def _shown(recording: Recording, role: Role, most: int) -> list[int]:
    """The columns of a role: those that were seen most, if there are too many, in their order."""
    columns = [i for i, channel in enumerate(recording.channels) if channel.role is role]
    if len(columns) <= most:
        return columns
    seen = np.isfinite(recording.values[:, columns]).sum(0)
    return sorted(columns[k] for k in np.argsort(-seen, kind="stable")[: max(most, 1)].tolist())


def _pack_steps(packing: Packing, account: Account, own: Sequence[int]) -> None:
    estimates, begin = account.estimates, account.begin
    packing.put("step_times", account.times - begin)
    for name in ("phase", "phase_std", "phase_velocity", "phase_velocity_std", "log_likelihood"):
        packing.put(name, [getattr(estimate, name) for estimate in estimates])
    order = list(Status)
    packing.put("status", [order.index(estimate.status) for estimate in estimates], "u1")
    packing.put("now_times", account.now_times - begin)
    packing.put_quantised("now", account.now[:, own])
    packing.put_quantised("now_std", account.now_std[:, own])
    packing.put_quantised("truth", account.truth[:, own])
    packing.put("progress", account.progress)


def _pack_commands(packing: Packing, account: Account, own: Sequence[int]) -> None:
    commands = account.recording.commands
    names = [account.names[i] for i in own]
    sent = np.full((len(commands), len(names)), np.nan)
    for i, command in enumerate(commands):
        for k, name in enumerate(names):
            if name in command.signals and len(command.positions):
                sent[i, k] = command.positions[0, command.signals.index(name)]
    packing.put("command_times", [command.time - account.begin for command in commands])
    packing.put_quantised("commands", sent)


def _pack_frames(packing: Packing, account: Account, own: Sequence[int]) -> None:
    frames = [frame for frame in account.frames if frame.response is not None and len(frame.response)]
    samples = max((len(frame.response) for frame in frames if frame.response is not None), default=0)
    times, phases = np.full((len(frames), samples), np.nan), np.full((len(frames), samples), np.nan)
    mean, std = (np.full((len(frames), samples, len(own)), np.nan) for _ in range(2))
    names = [account.names[i] for i in own]
    for i, frame in enumerate(frames):
        response = frame.response
        if response is None:
            continue
        times[i, : len(response)], phases[i, : len(response)] = response.times - account.begin, response.phases
        for k, name in enumerate(names):
            if name in response.channels:
                column = response.channels.index(name)
                mean[i, : len(response), k] = response.mean[:, column]
                std[i, : len(response), k] = response.std[:, column]
    packing.put("frame_steps", [frame.step for frame in frames], "u4")
    packing.put("response_times", times)
    packing.put_quantised("response_phases", phases[..., None])
    packing.put_quantised("response_mean", mean)
    packing.put_quantised("response_std", std)


def _pack_belief(packing: Packing, account: Account) -> list[dict[str, Any]]:
    """The frames' clouds, densities and correlations; which features these are of, with their weights' places."""
    lens, model = account.lens, account.model
    frames = [frame for frame in account.frames if frame.glimpse is not None]
    if lens is None or model is None or not frames:
        return []
    glimpses = [frame.glimpse for frame in frames if frame.glimpse is not None]
    packing.put("belief_steps", [frame.step for frame in frames], "u4")
    packing.put_quantised("cloud", np.stack([glimpse.points for glimpse in glimpses]))
    packing.put("demonstrations", lens.demonstrations)
    packing.put("shares", lens.shares)
    packing.put("tempos", lens.tempos)
    for name in ("phase_density", "tempo_density"):
        densities = np.stack([getattr(glimpse, name) for glimpse in glimpses])
        most = np.maximum(densities.max(1, keepdims=True), np.finfo(float).tiny)
        packing.put(name, np.round(255 * densities / most), "u1")
        packing.put(f"{name}_most", most[:, 0])
    features = _correlated(account)
    upper = np.triu_indices(len(lens.directions))
    covs = np.stack([glimpse.cov for glimpse in glimpses])
    packing.put("cov", covs[:, upper[0], upper[1]])
    across = np.triu_indices(len(features), 1)
    phases = np.array([account.estimates[frame.step].phase for frame in frames])
    tables = lens.correlations(covs, phases, features)[:, across[0], across[1]]
    packing.put("correlation", np.round(127 * tables), "i1")
    slices = [model.layout.slices[feature] for feature in features]
    packing.put("directions", np.concatenate([lens.directions[:, part] for part in slices], axis=1))
    sizes = [part.stop - part.start for part in slices]
    starts = np.cumsum([0, *sizes[:-1]]).tolist()
    roles = [model.channels[model.coordinates.channel_of[feature][0]].role.value for feature in features]
    return [
        {"name": model.coordinates.names[feature], "start": start, "size": size, "role": role}
        for feature, start, size, role in zip(features, starts, sizes, roles, strict=True)
    ]


def _correlated(account: Account) -> Int[np.ndarray, " M"]:
    """The features whose mean moves most, as many of either partner, in their order."""
    model = account.model
    if model is None:
        return np.zeros(0, dtype=np.int64)
    mean: Float[np.ndarray, "P F"] = model.layout.predict(np.linspace(0, 1, 50), model.prior.mean)
    moves, shown = np.ptp(mean, axis=0), model.observed_features
    of_partner = np.argsort(-moves[:shown], kind="stable")
    own = np.argsort(-moves[shown:], kind="stable") + shown
    half = CORRELATED // 2
    more = CORRELATED - min(len(own), half), CORRELATED - min(len(of_partner), half)
    return np.sort(np.concatenate([of_partner[: more[0]], own[: more[1]]]))[:CORRELATED]
