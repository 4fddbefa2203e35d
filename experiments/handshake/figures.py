"""What the tests tell in pictures: Figs. 15 to 20, and the films."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from experiments.handshake.anatomy import NAMES, STILL
from experiments.handshake.measures import correlations, sliding
from experiments.handshake.sensors import HAND, RATE
from experiments.handshake.tell import LED, trials
from experiments.handshake.tell import NAMES as METHODS
from experiments.handshake.trajectories import TESTING
from experiments.study import Found, Page, Settings, Table
from inphase.report.look import COLOURS, NOW, PAST, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("bip", "rbpf")


def panels(rows: int, columns: int, size: tuple[float, float], **options: object) -> tuple[Figure, np.ndarray]:
    """A figure and its axes (rows, columns), in the look of all pictures."""
    from matplotlib.figure import Figure as New

    figure = New(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.ravel():
        plain(ax)
    return figure, axes


def prediction(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 17: normal, fast, and fast to another place."""
    leading = settings.of("leading")
    muscle = NAMES.index("biceps")
    rows = (("normal", 0), ("fast", 0), ("fast", -1))
    figure, axes = panels(3, len(SHOWN), (10, 7), sharex=True, sharey=True)
    times, moments = np.arange(301) / RATE, []
    for j, method in enumerate(SHOWN):
        for ax, (speed, which) in zip(axes[:, j], rows, strict=True):
            i = LED.index(speed)
            read = trials(leading, i, len(LED), "read", method)[0][which]
            plans = trials(leading, i, len(LED), "responses", method)[0][which]
            made = [p for p in plans if np.isfinite(p).all()][:17]
            moments.append(float(made[-1][0, 0]))
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
    page.say(
        f"Blue: a prediction, {min(moments):.1f} to {max(moments):.1f} s after the beginning; red: the 15 before it, a "
        "third of a second apart; orange: the hand, x."
    )


def profiles(settings: Settings, found: Found, page: Page) -> None:
    """Fig. 18: how the partner's hand moves."""
    static, leading = settings.of("static"), settings.of("leading")
    groups = {"static": np.concatenate([trials(static, i, len(TESTING), "truth")[0] for i in range(len(TESTING))])}
    # Who leads does the same whoever moves the robot.
    groups["partner leads"] = np.concatenate([trials(leading, i, len(LED), "truth", "rbpf")[0] for i in range(3)])
    figure, axes = panels(3, 2, (9, 6.5), sharex=True)
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
    figure, axes = panels(1, len(groups), (11, 4))
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
    figure, axes = panels(1, len(groups), (10, 2.8))
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
