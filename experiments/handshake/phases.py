"""What is believed of phase and tempo when partners are equally far: Figs. 15 and 16."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from experiments.handshake.encounter import LASTS
from experiments.handshake.figures import SHOWN, panels
from experiments.handshake.lead import RESPONDS
from experiments.handshake.measures import gone
from experiments.handshake.partner import SPEEDS
from experiments.handshake.sensors import RATE
from experiments.handshake.tell import LED, played, trials
from experiments.handshake.tell import NAMES as METHODS
from experiments.study import Found, Page, Settings, Table
from inphase.report.look import COLOURS, INK

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REGIONS = (("#d1603d", "has not moved"), ("#3f8f5f", "moves"), ("#0b6e99", "has arrived"))
SHARES = (0.5, 0.9)  # of the partner's way
FAST_SLOW = ("fast", "slow")


def phase(settings: Settings, found: Found, page: Page) -> None:
    """Figs. 15 and 16."""
    leading = settings.of("leading")
    for method in SHOWN:
        page.picture(_regions(settings, method), f"phase-{method}", f"phase at the ends of three regions, {method}")
    page.picture(_distributions(settings), "phase-all", "phase and velocity when the partner has arrived")
    methods = played(leading)
    page.table(_arrived(leading))
    _say_ratios(
        page,
        "when the partner has arrived",
        {
            m: [trials(leading, LED.index(s), len(LED), "at_moments", m)[0][:, 1, [0, 2]] for s in FAST_SLOW]
            for m in methods
        },
    )
    shown = _shown(settings.of("training"))
    way = {m: {s: _on_the_way(leading, m, s) for s in LED[:3]} for m in methods}
    table = Table("how much of the way is done, median", [*methods.values(), "demonstrations"])
    for k, share in enumerate(SHARES):
        for column, name in enumerate(("phase", "velocity [1/s]")):
            for speed in LED[:3]:
                cells = {methods[m]: f"{np.median(way[m][speed][:, k, column]):.3f}" for m in methods}
                cells["demonstrations"] = f"{np.median(shown[:, k]):.3f}" if column == 0 else ""
                table.add(f"{share:.0%}, {name}, {speed}", cells)
    page.table(table)
    for k, share in enumerate(SHARES):
        _say_ratios(
            page, f"with {share:.0%} of the way done", {m: [way[m][s][:, k] for s in FAST_SLOW] for m in methods}
        )
    page.say(
        "The dissertation's finding, that the phase is the same and the velocity is not, would be 1 and the ratio of "
        f"the tempi, {SPEEDS['slow'] / SPEEDS['fast']:.0f}. A hand that arrives slowly looks like one that rests, long "
        "before it is there; a fast partner is halfway before their tempo is known."
    )


def _arrived(leading: Found) -> Table:
    methods = played(leading)
    table = Table("when the partner has arrived, mean ± std", list(methods.values()))
    rows: dict[str, dict[str, str]] = {}
    for method, column in methods.items():
        at = {s: trials(leading, i, len(LED), "at_moments", method)[0] for i, s in enumerate(LED)}
        for speed in ("fast", "normal", "slow", "paused"):
            green = at[speed][:, 1]
            for name, k in (("phase", 0), ("velocity [1/s]", 2)):
                rows.setdefault(f"{name}, {speed}", {})[column] = f"{green[:, k].mean():.3f} ± {green[:, k].std():.3f}"
        rows.setdefault("velocity of a still partner at the end", {})[column] = f"{at['still'][:, 2, 2].mean():.4f}"
        rows.setdefault("velocity at the end of a pause", {})[column] = f"{at['paused'][:, 0, 2].mean():.4f}"
    for name in sorted(rows):
        table.add(name, rows[name])
    return table


def _say_ratios(page: Page, when: str, found: dict[str, list[np.ndarray]]) -> None:
    """Of fast over slow: found has (N, 2) phases and velocities of both, by method."""
    ratios = {m: np.median(fast, axis=0) / np.median(slow, axis=0) for m, (fast, slow) in found.items()}
    page.say(
        f"Fast against slow, {when} (ratio of the medians): "
        + "; ".join(f"{m} phase {phase:.2f}, velocity {velocity:.2f}" for m, (phase, velocity) in ratios.items())
        + "."
    )


def _on_the_way(leading: Found, method: str, speed: str) -> np.ndarray:
    """(N, SHARES, 2) phase and velocity when the partner's hand has gone that much of its way."""
    i = LED.index(speed)
    beliefs, truth = (trials(leading, i, len(LED), name, method)[0] for name in ("beliefs", "truth"))
    grid = np.arange(beliefs.shape[1]) / RESPONDS
    at = np.array([[gone(t[:, 3:], share) for share in SHARES] for t in truth])
    return np.stack(
        [[np.interp(when, grid, belief[:, k]) for k in (0, 2)] for when, belief in zip(at, beliefs, strict=True)]
    ).transpose(0, 2, 1)


def _shown(training: Found) -> np.ndarray:
    """(N, SHARES) phases at which the hands of demonstrations had gone that much of their way."""
    truth = np.concatenate([found["truth"] for found in training.values()])
    return np.array([[gone(t[:, 3:], share) / LASTS for share in SHARES] for t in truth])


def _regions(settings: Settings, method: str) -> Figure:
    """Fig. 15 and the right of Fig. 16, of the first person."""
    leading = settings.of("leading")
    figure, axes = panels(3, len(LED), (12, 6), sharey="row")
    times = np.arange(301) / RATE
    for i, speed in enumerate(LED):
        truth = trials(leading, i, len(LED), "truth", method)[0][0]
        read = trials(leading, i, len(LED), "read", method)[0][0]
        moments = trials(leading, i, len(LED), "moments", method)[0][0]
        beliefs = trials(leading, i, len(LED), "at_moments", method)[0][0]
        top, middle, bottom = axes[:, i]
        top.plot(times[: len(truth)], read[:, 0], color=INK, lw=1)
        top.set_title(speed, fontsize=10)
        top.set_xlabel("time [s]")
        edges = [0.0, *np.minimum(moments, 10.0)] if np.isfinite(moments).all() else [0.0, 10.0]
        for r, (colour, _) in enumerate(REGIONS[: len(edges) - 1]):
            top.axvspan(edges[r], edges[r + 1], color=colour, alpha=0.18, lw=0)
            _density(middle, *beliefs[r if len(edges) > 2 else 2, :2], (-0.05, 1.05), colour)
            _density(bottom, *beliefs[r if len(edges) > 2 else 2, 2:], (-0.3, 0.6), colour)
        middle.set_xlabel("phase")
        bottom.set_xlabel("phase velocity [1/s]")
    axes[0, 0].set_ylabel("hand x [m]")
    axes[1, 0].set_ylabel("density")
    axes[2, 0].set_ylabel("density")
    figure.suptitle(f"{METHODS[method]}: at the end of each region", fontsize=11)
    return figure


def _density(ax: object, mean: float, std: float, limits: tuple[float, float], colour: str) -> None:
    """A Gaussian, its height 1 so that sharp ones and wide ones can be seen together."""
    x = np.linspace(*limits, 400)
    std = max(std, 0.004 * (limits[1] - limits[0]))
    y = np.exp(-0.5 * ((x - mean) / std) ** 2)
    ax.fill_between(x, y, color=colour, alpha=0.35, lw=0)  # type: ignore[attr-defined]
    ax.plot(x, y, color=colour, lw=1)  # type: ignore[attr-defined]
    ax.set_yticks([])  # type: ignore[attr-defined]


def _distributions(settings: Settings) -> Figure:
    """The left of Fig. 16, of all tests, for every method."""
    leading = settings.of("leading")
    methods = played(leading)
    figure, axes = panels(2, len(methods), (10, 4.6), sharey=False)
    for j, (method, title) in enumerate(methods.items()):
        axes[0, j].set_title(title, fontsize=10)
        for k, (row, name, limits) in enumerate(((0, "phase", (0, 1)), (2, "phase velocity [1/s]", (-0.1, 0.6)))):
            ax = axes[k, j]
            for i, speed in enumerate(LED[:3]):
                values = np.clip(trials(leading, i, len(LED), "at_moments", method)[0][:, 1, row], *limits)
                ax.hist(values, np.linspace(*limits, 26), color=COLOURS[i], alpha=0.5, label=speed)
            ax.set_xlabel(name)
    axes[0, 0].set_ylabel("tests")
    axes[1, 0].set_ylabel("tests")
    axes[0, 0].legend(frameon=False, fontsize=8)
    return figure
