"""What the tests tell in pictures: Figs. 15 to 20, and the films."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from experiments.handshake.anatomy import NAMES, STILL
from experiments.handshake.measures import correlations, sliding
from experiments.handshake.partner import SPEEDS
from experiments.handshake.sensors import HAND, RATE
from experiments.handshake.tell import LED, played, trials
from experiments.handshake.tell import NAMES as METHODS
from experiments.handshake.trajectories import TESTING
from experiments.study import Found, Page, Settings, Table
from inphase.report.look import COLOURS, INK, NOW, PAST, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REGIONS = (("#d1603d", "has not moved"), ("#3f8f5f", "moves"), ("#0b6e99", "has arrived"))
SHOWN = ("bip", "rbpf")


def _figure(rows: int, columns: int, size: tuple[float, float], **options: object) -> tuple[Figure, np.ndarray]:
    from matplotlib.figure import Figure as New

    figure = New(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.ravel():
        plain(ax)
    return figure, axes


def phase(settings: Settings, found: Found, page: Page) -> None:
    """Figs. 15 and 16."""
    leading = settings.of("leading")
    for method in SHOWN:
        page.picture(_regions(settings, method), f"phase-{method}", f"phase at the ends of three regions, {method}")
    page.picture(_distributions(settings), "phase-all", "phase and velocity when the partner has arrived")
    methods = played(leading)
    table = Table("when the partner has arrived, mean ± std", list(methods.values()))
    rows: dict[str, dict[str, str]] = {}
    ratios = {}
    for method, column in methods.items():
        at = {s: trials(leading, i, len(LED), "at_moments", method)[0] for i, s in enumerate(LED)}
        for speed in ("fast", "normal", "slow", "paused"):
            green = at[speed][:, 1]
            for name, k in (("phase", 0), ("velocity [1/s]", 2)):
                rows.setdefault(f"{name}, {speed}", {})[column] = f"{green[:, k].mean():.3f} ± {green[:, k].std():.3f}"
        rows.setdefault("velocity of a still partner at the end", {})[column] = f"{at['still'][:, 2, 2].mean():.4f}"
        rows.setdefault("velocity at the end of a pause", {})[column] = f"{at['paused'][:, 0, 2].mean():.4f}"
        ratios[method] = [float(np.median(at["fast"][:, 1, k]) / np.median(at["slow"][:, 1, k])) for k in (0, 2)]
    for name in sorted(rows):
        table.add(name, rows[name])
    page.table(table)
    page.say(
        "Fast against slow, when the partner has arrived (ratio of the medians): "
        + "; ".join(f"{m} phase {p:.2f}, velocity {v:.2f}" for m, (p, v) in ratios.items())
        + ". The dissertation's finding, that the phase is the same and the velocity is not, would be 1 and the ratio "
        f"of the tempi, {SPEEDS['slow'] / SPEEDS['fast']:.0f}."
    )


def _regions(settings: Settings, method: str) -> Figure:
    """Fig. 15 and the right of Fig. 16, of the first person."""
    leading = settings.of("leading")
    figure, axes = _figure(3, len(LED), (12, 6), sharey="row")
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
    figure, axes = _figure(2, len(methods), (10, 4.6), sharey=False)
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


def prediction(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 17: normal, fast, and fast to another place."""
    leading = settings.of("leading")
    muscle = NAMES.index("biceps")
    rows = (("normal", 0), ("fast", 0), ("fast", -1))
    figure, axes = _figure(3, len(SHOWN), (10, 7), sharex=True, sharey=True)
    times = np.arange(301) / RATE
    for j, method in enumerate(SHOWN):
        for ax, (speed, which) in zip(axes[:, j], rows, strict=True):
            i = LED.index(speed)
            read = trials(leading, i, len(LED), "read", method)[0][which]
            plans = trials(leading, i, len(LED), "responses", method)[0][which]
            made = [p for p in plans if np.isfinite(p).all()][:17]
            for age, plan in enumerate(made[-16:-1]):
                ax.plot(plan[:, 0], plan[:, 1 + muscle], color=COLOURS[1], lw=0.7, ls="--", alpha=0.25 + 0.03 * age)
            ax.plot(made[-1][:, 0], made[-1][:, 1 + muscle], color=NOW, lw=1.6, ls="--", label="predicted now")
            ax.plot(*made[-1][0, [0, 1 + muscle]], "o", color=NOW, ms=4)
            ax.plot(times[: len(read)], read[:, 3 + muscle], color=PAST, lw=1.6, label="pressure as it was")
            ax.set_title(f"{METHODS[method]}: {speed}{' to another place' if which else ''}", fontsize=9)
            ax.set_xlim(0, 10.5)
            hand = ax.twinx()
            hand.plot(times[: len(read)], read[:, 0], color=COLOURS[2], lw=1, label="hand x")
            hand.set_ylim(0.2, 1.1)
            hand.set_yticks([])
            hand.spines[["top", "right"]].set_visible(False)
    for ax in axes[:, 0]:
        ax.set_ylabel("biceps [MPa]")
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    axes[0, 0].legend(frameon=False, fontsize=8, loc="upper right")
    page.picture(
        figure, "prediction", "predicted pressure of the biceps, earlier predictions, and the pressure as it was"
    )
    page.say("Blue: the prediction after 5.6 s; red: the 15 before it, a third of a second apart; orange: the hand, x.")


def profiles(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 18: how the partner's hand moves."""
    static, leading = settings.of("static"), settings.of("leading")
    groups = {"static": np.concatenate([trials(static, i, len(TESTING), "truth")[0] for i in range(len(TESTING))])}
    # Who leads does the same whoever moves the robot.
    groups["partner leads"] = np.concatenate([trials(leading, i, len(LED), "truth", "rbpf")[0] for i in range(3)])
    figure, axes = _figure(3, 2, (9, 6.5), sharex=True)
    times, peaks = np.arange(301) / RATE, {}
    for colour, (name, truth) in zip((COLOURS[1], NOW), groups.items(), strict=True):
        hand = truth[:, :, 3:].astype(float)
        smooth = np.apply_along_axis(lambda v: np.convolve(np.pad(v, 3, "edge"), np.ones(7) / 7, "valid"), 1, hand)
        speed = np.gradient(smooth, 1 / RATE, axis=1)
        peaks[name] = float(times[np.argmax(np.linalg.norm(speed, axis=2).mean(0))])
        for d, label in enumerate("xyz"):
            for column, values in ((0, hand[:, :, d]), (1, speed[:, :, d])):
                mean, std = values.mean(0), values.std(0)
                t = times[: len(mean)]
                axes[d, column].fill_between(t, mean - std, mean + std, color=colour, alpha=0.18, lw=0)
                axes[d, column].plot(t, mean, color=colour, lw=1.4, label=name)
            axes[d, 0].set_ylabel(f"{label} [m]")
            axes[d, 1].set_ylabel(f"{label} [m/s]")
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    axes[0, 0].legend(frameon=False, fontsize=8)
    page.picture(figure, "profiles", "position and velocity of the partner's hand, mean and standard deviation")
    page.say("The mean speed is greatest at " + ", ".join(f"{at:.1f} s ({name})" for name, at in peaks.items()) + ".")


def correlation(settings: Settings, found: Found, page: Page) -> None:
    """Figs. 19 and 20."""
    static, leading = settings.of("static"), settings.of("leading")
    groups = {"static": np.concatenate([trials(static, i, len(TESTING), "read")[0] for i in range(len(TESTING))])}
    groups |= {m: np.concatenate([trials(leading, i, len(LED), "read", m)[0] for i in range(3)]) for m in SHOWN}
    figure, axes = _figure(1, len(groups), (11, 4))
    table = Table(
        "mean size of the correlation of hand and", ["muscles that were commanded", "muscles that never were"]
    )
    for ax, (name, read) in zip(axes[0], groups.items(), strict=True):
        mean = np.mean([correlations(r) for r in read], axis=0)
        shown = ax.imshow(np.abs(mean), vmin=0, vmax=1, cmap="viridis")
        ax.set_title(name, fontsize=10)
        ax.grid(False)
        ax.set_xlabel("pressures 0 to 26, hand 27 to 29")
        of_hand = np.abs(mean[-len(HAND) :, : len(STILL)])
        table.add(name, {c: f"{of_hand[:, s].mean():.2f}" for c, s in zip(table.columns, (~STILL, STILL), strict=True)})
    figure.colorbar(shown, ax=axes[0].tolist(), shrink=0.8)
    page.picture(figure, "correlation", "size of the mean correlations of 27 pressures and the hand")
    page.table(table)
    muscle = int(np.flatnonzero(STILL)[0])
    figure, axes = _figure(1, len(groups), (10, 2.8))
    for ax, (name, read) in zip(axes[0], groups.items(), strict=True):
        values = np.concatenate([sliding(r, 1, len(HAND) + muscle) for r in read])
        ax.hist(values[np.isfinite(values)], np.linspace(-1, 1, 41), color=NOW, density=True)
        ax.set_title(name, fontsize=10)
        ax.set_xlabel("correlation in windows of 2 s")
    page.picture(figure, "histogram", f"correlation of {NAMES[muscle]}, which is never commanded, and hand y")


def film(settings: Settings, found: Found, page: Page) -> None:
    """Figs. 12 to 14."""
    from experiments.handshake.film import FPS, strip

    if not found:
        page.say("Made with the whole study.")
        return
    for name, shown in found.items():
        page.film(list(shown["frames"]), f"film-{name}", f"a handshake, {name}", FPS)
    figure = strip({name: shown["frames"] for name, shown in found.items()})
    page.picture(figure, "strip", "fast, slow and still partners, a picture every 0.9 s")
