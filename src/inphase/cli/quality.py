"""How good demonstrations are, in a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from inphase.cli.console import counted
from inphase.training.quality import EpisodeQuality, Quality
from inphase.trajectory import Dataset

NARROW = 110  # columns: with less, only what decides is shown
LEGEND = {
    "likely": "log-likelihood of its movement under the Gaussian of all others [nat a reading]",
    "far": "how far it lies outside of what is usual [robust standard deviations]",
    "adds": "by how much the log-likelihood of the others falls without it [nat a reading]",
}


def describe_quality(dataset: Dataset, quality: Quality) -> dict[str, Any]:
    """The quality of a data set as plain values; times in [s], rates in [1/s]."""
    return {
        "episodes": [
            {
                "name": e.name,
                "samples": e.sampling.samples,
                "duration": e.sampling.duration,
                "start": e.sampling.start,
                "end": e.sampling.end,
                "rate": e.sampling.rate,
                "jitter": e.sampling.jitter,
                "longest_gap": e.sampling.longest_gap,
                "missing": {
                    name: float(share)
                    for name, share in zip(dataset.names, e.sampling.missing, strict=True)
                    if share > 0
                },
                "moves": list(e.moves),
                "log_likelihood": e.log_likelihood,
                "score": e.score,
                "contribution": e.contribution,
                "outlier": e.outlier,
                "unlike": [asdict(part) for part in e.unlike],
                "late": e.late,
                "verdict": e.verdict,
            }
            for e in quality.episodes
        ],
        "findings": [asdict(finding) for finding in quality.findings],
        "threshold": quality.threshold,
        "error_rate": quality.error_rate,
        "shrinkage": quality.shrinkage,
        "why_not": quality.why_not,
    }


def print_quality(console: Console, dataset: Dataset, quality: Quality) -> None:
    """What is wrong with channels, then an episode a row, the worst first."""
    for finding in quality.findings:
        console.print(f"{finding.kind}: {finding.message}", style="yellow")
    console.print()
    worst_first = sorted(quality.episodes, key=lambda e: -(e.score or 0.0))
    rows = [_row(e) for e in worst_first]
    titles = [t for t in rows[0] if any(row[t] for row in rows) and (console.width >= NARROW or t not in OPTIONAL)]
    table = Table(box=None, pad_edge=False)
    for title in titles:
        is_text = title in ("episode", "")
        table.add_column(title, justify="left" if is_text else "right", no_wrap=not is_text, overflow="fold")
    for episode, row in zip(worst_first, rows, strict=True):
        table.add_row(*(row[title] for title in titles), style="red" if episode.outlier else "")
    console.print(table, soft_wrap=False)
    if quality.threshold is None:
        console.print(f"none is held against the others: {quality.why_not}")
        return
    console.print("; ".join(f"{t}: {said}" for t, said in LEGEND.items() if t in titles), style="dim", soft_wrap=False)
    names = [episode.name for episode in quality.outliers]
    chance = f"one of {counted(len(quality.episodes), 'episode')} is in 1 of {1 / quality.error_rate:.0f} data sets"
    console.print(
        (f"{_are(names)} unlike the others" if names else "none is unlike the others")
        + f": further off than {quality.threshold:.3g}, as by chance {chance} at most",
        soft_wrap=False,
    )


OPTIONAL = ("samples", "jitter", "likely")


def _row(episode: EpisodeQuality) -> dict[str, str]:
    sampling = episode.sampling
    missing = float(sampling.missing.mean())
    idle = episode.moves != (sampling.start, sampling.end)
    return {
        "episode": episode.name,
        "[s]": f"{sampling.duration:.2f}",
        "samples": str(sampling.samples),
        "Hz": f"{sampling.rate:.3g}",
        "jitter": f"{100 * sampling.jitter:.0f} %",
        "gap [s]": f"{sampling.longest_gap:.2g}" if sampling.longest_gap else "",
        "missing": f"{100 * missing:.1f} %" if missing else "",
        "moves [s]": f"{episode.moves[0]:.2f} … {episode.moves[1]:.2f}" if idle else "",
        "likely": "" if episode.log_likelihood is None else f"{episode.log_likelihood:.2f}",
        "far": "" if episode.score is None else f"{episode.score:.1f}",
        "adds": "" if episode.contribution is None else f"{episode.contribution:+.3f}",
        "": episode.verdict,
    }


def _are(names: Sequence[str]) -> str:
    return f"{names[0]} is" if len(names) == 1 else f"{len(names)} are"
