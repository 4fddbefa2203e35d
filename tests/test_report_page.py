"""The report's page in a real browser: what it shows at a step is what Python says, and nothing in it is executed."""

from __future__ import annotations

import re
import socket
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import NARROW, browser, watched
from interactions import dataset, taught
from numpy.testing import assert_allclose

import inphase
from inphase.channels import make_channels
from inphase.recording import RecordedEvent, Recording
from inphase.replay import provenance_of
from inphase.report.account import SAMPLES, account_of_demonstration, account_of_recording
from inphase.report.glimpse import Lens
from inphase.report.page.document import HERE, write_page
from inphase.report.page.packing import STEPS, Packing

NINETY = 1.6449
OBSERVED, CONTROLLED = [f"seen_{i}" for i in range(5)], [f"own_{i}" for i in range(6)]
HOSTILE = [
    "<img src=x onerror=alert(1)>",
    "<!--<script </script><script>alert(2)</script>",
    "$$\\sqrt{x}$$",
    "{{title}}",
    "\"'&amp;`${alert(3)}",
    "größe 手 \u202e\u2028",
]
DARK = {"color_scheme": "dark"}


def wider(demos: inphase.Dataset, observed: list[str], controlled: list[str]) -> inphase.Dataset:
    """The same interactions in more channels, each a mixture."""
    rng = np.random.default_rng(2)
    partner, own = rng.standard_normal((2, len(observed))), rng.standard_normal((2, len(controlled)))
    values = [np.column_stack([d.values[:, :2] @ partner, d.values[:, 2:] @ own]) for d in demos]
    return inphase.Dataset.from_arrays([d.times for d in demos], values, observed, controlled, units={"*": "m"})


@pytest.fixture(scope="module")
def played():
    """A model, and an episode in which nothing was seen for a while."""
    demos = wider(dataset(np.random.default_rng(0), count=6, rate=20.0), OBSERVED, CONTROLLED)
    model, episode = taught(demos.without(-1)), demos[-1]
    values = np.array(episode.values)
    values[20:28, : len(OBSERVED)] = np.nan
    return model, inphase.Demonstration(episode.times, values, "episode 6")


@pytest.fixture(scope="module")
def told(played):
    """What Python says of the same run: at every step the estimate, the response and the belief."""
    model, episode = played
    session, steps = model.session("bip"), []
    for time, values in zip(episode.times, episode.values, strict=True):
        estimate = session.observe(float(time), values[: len(OBSERVED)])
        steps.append((estimate, session.respond(samples=SAMPLES), session.belief))
    return steps


@pytest.fixture(scope="module")
def pages(played, tmp_path_factory):
    """The files: one run; three that are compared; one whose every name and word is hostile."""
    folder = tmp_path_factory.mktemp("reports")
    model, episode = played
    one = account_of_demonstration(model, episode, "bip")
    other = inphase.Demonstration(1.4 * episode.times, episode.values, "slow")
    three = [
        one,
        account_of_demonstration(model, episode, "ebip", members=30),
        account_of_demonstration(model, other, "bip"),
    ]
    write_page(folder / "one.html", [one])
    write_page(folder / "three.html", three, "compared")
    write_page(folder / "hostile.html", [hostile(episode)], f"{HOSTILE[3]} </title>{HOSTILE[1]} {HOSTILE[2]}")
    return folder


def hostile(episode):
    demos = wider(dataset(np.random.default_rng(0), count=4, rate=20.0), HOSTILE[:3], HOSTILE[3:])
    channels = make_channels(HOSTILE[:3], HOSTILE[3:], units={"*": HOSTILE[0]}, groups={"*": HOSTILE[1]})
    model = taught(inphase.Dataset(channels, demos.demonstrations))
    values = np.array(demos[0].values)[:, : len(HOSTILE)]
    events = tuple(RecordedEvent(0.1 * i, word, word, word, word) for i, word in enumerate(HOSTILE, 1))
    told = {**provenance_of(model, "bip"), "damage": HOSTILE[0]}
    recording = Recording(HOSTILE[1], channels, demos[0].times, values, (), (), told, events=events)
    account = account_of_recording(recording, model, title=HOSTILE[0])
    return replace(account, remarks=tuple(HOSTILE))


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


class Report:
    """A report that is open."""

    def __init__(self, page, path: Path) -> None:
        self.page = page
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready=true]")
        self.settle()

    def settle(self) -> None:
        """Until what was asked for is drawn."""
        self.page.evaluate(
            """() => new Promise(done => {
                let frames = 6;
                (function next() { frames-- ? requestAnimationFrame(next) : done(); })();
            })"""
        )

    @property
    def step(self) -> int:
        return int(self.page.evaluate("document.documentElement.dataset.step"))

    def press(self, key: str) -> int:
        self.page.keyboard.press(key)
        self.settle()
        return self.step

    def to(self, step: int) -> None:
        self.page.locator("#step").fill(str(step))
        self.settle()
        assert self.step == step

    def data(self, name: str) -> dict[str, np.ndarray]:
        """What bokeh holds."""
        found = self.page.evaluate(
            """name => Object.fromEntries(Object.entries(Bokeh.documents[0].get_model_by_name(name).data).map(
                ([key, column]) => [key, Array.from(column, x => x.length === undefined ? x : Array.from(x))]))""",
            name,
        )
        return {
            key: column if column and isinstance(column[0], list) else np.array(column, float)
            for key, column in found.items()
        }

    def range(self, name: str = "observed-0") -> tuple[float, float]:
        """Of the horizontal axis, as the figure draws it."""
        return tuple(
            self.page.evaluate(f"(() => {{ const r = {VIEW(name)}.frame.x_range; return [r.start, r.end]; }})()")
        )

    def place(self, name: str, x: float, y: float = 0.0) -> tuple[float, float]:
        """Where a figure draws a point, in pixels of the window, by bokeh's own scales."""
        return tuple(
            self.page.evaluate(
                f"""([x, y]) => {{ const view = {VIEW(name)}, box = view.el.getBoundingClientRect();
                return [box.left + view.frame.x_scale.compute(x), box.top + view.frame.y_scale.compute(y)]; }}""",
                [x, y],
            )
        )

    def show(self, selector: str) -> None:
        """Scroll until it stands below the bar."""
        self.page.evaluate("s => { document.querySelector(s).scrollIntoView(); scrollBy(0, -130); }", selector)
        self.settle()

    def over(self, name: str, part: str) -> list[dict[str, float]]:
        """Boxes of what is laid over a figure, as far as it is shown."""
        return self.page.evaluate(
            """([name, part]) => Array.from(document.querySelectorAll(`[data-plot="${name}"] .over.${part}`))
                .filter(e => e.style.display !== "none").map(e => e.getBoundingClientRect().toJSON())""",
            [name, part],
        )

    def text(self, selector: str) -> str:
        return self.page.locator(selector).inner_text()

    def table(self, selector: str) -> list[list[str]]:
        return self.page.evaluate(
            "s => Array.from(document.querySelector(s).rows, row => Array.from(row.cells, cell => cell.textContent))",
            selector,
        )


def VIEW(name: str) -> str:
    return f"Bokeh.index.find_one(Bokeh.documents[0].get_model_by_name('{name}'))"


@pytest.fixture
def opened(chromium, pages):
    """Open one of the pages; whatever went wrong in it fails the test."""
    with ExitStack() as stack:

        def open_page(name: str, **context) -> Report:
            seen = stack.enter_context(watched(chromium, **context))
            seen.page.on("dialog", lambda dialog: (seen.troubles.append(f"dialog: {dialog.message}"), dialog.dismiss()))
            return Report(seen.page, pages / f"{name}.html")

        yield open_page


@pytest.fixture(scope="module")
def one(chromium, pages):
    """The page of one run, which the tests that only look share."""
    with watched(chromium) as seen:
        yield Report(seen.page, pages / "one.html")


def number(text: str) -> float:
    return float(text.replace("−", "-").replace("–", "nan"))


def span(values: np.ndarray) -> float:
    return float(np.nanmax(values) - np.nanmin(values))


# ------------------------------------------------------------------------------------------------------------ the steps


def test_keys_slider_and_buttons_go_through_the_steps(one, told):
    last = len(told) - 1
    one.to(0)
    one.page.locator("#title").click()
    keys = ["ArrowRight", "Shift+ArrowRight", "ArrowLeft", "Shift+ArrowLeft", "ArrowLeft", "End", "ArrowRight", "Home"]
    assert [one.press(key) for key in keys] == [1, 11, 10, 0, 0, last, last, 0]
    one.page.locator("#step").focus()  # the slider does not move twice
    assert [one.press(key) for key in ["ArrowRight", "Shift+ArrowRight", "End", "Home"]] == [1, 11, last, 0]
    one.page.locator("#speed").focus()  # a list has the arrow keys for itself
    one.press("ArrowRight")
    assert one.step == 0
    one.page.locator("#speed").select_option("1")
    for button, step in (("#forth", 1), ("#forth", 2), ("#back", 1), ("#back", 0), ("#back", 0)):
        one.page.locator(button).click()
        one.settle()
        assert one.step == step
    assert one.page.locator("#step").get_attribute("max") == str(last)


def test_it_plays_at_the_speed_that_was_chosen_and_stops_at_the_end(one, told):
    one.to(0)
    one.page.locator("#speed").select_option("10")
    one.page.locator("#play").click()
    assert "stop" in one.text("#play")
    one.page.wait_for_function(f"document.documentElement.dataset.step === '{len(told) - 1}'", timeout=10_000)
    one.page.wait_for_function("document.getElementById('play').textContent.includes('play')")
    one.page.locator("#speed").select_option("0.25")
    one.page.locator("#title").click()
    one.page.keyboard.press("Space")  # from the beginning again
    one.page.wait_for_function("['1', '2', '3', '4'].includes(document.documentElement.dataset.step)", timeout=10_000)
    one.page.keyboard.press("Space")
    one.settle()
    at = one.step
    one.page.wait_for_timeout(250)
    assert one.step == at


# --------------------------------------------------------------------------------------------------- everything follows


def channel_of(one, kind, slot):
    """The channel that a figure shows, by its heading."""
    name, unit = re.fullmatch(r"(.*) \[(.*)\]", one.text(f"[data-plot='{kind}-{slot}'] figcaption")).groups()
    assert unit == "m"
    return (OBSERVED if kind == "observed" else CONTROLLED).index(name)


@pytest.mark.parametrize("step", [0, 9, 24, -1])
def test_at_every_step_it_shows_what_python_says(step, one, told, played):
    _, episode = played
    step %= len(told)
    one.show("#controlled")
    one.to(step)
    estimate, response, _ = told[step]
    for slot in range(4):
        k, name = channel_of(one, "controlled", slot), f"controlled-{slot}"
        close = {"atol": 1e-4 * span(episode.values[:, len(OBSERVED) + k]), "rtol": 0}
        shown, band = one.data(f"{name}:response"), one.data(f"{name}:band")
        assert_allclose(shown["x"], response.times - episode.times[0], atol=1e-5)
        assert_allclose(shown["y"], response.mean[:, k], **close)
        assert_allclose(band["low"], response.mean[:, k] - NINETY * response.std[:, k], **close)
        assert_allclose(band["high"], response.mean[:, k] + NINETY * response.std[:, k], **close)
        past = one.data(f"{name}:past")["ys"]
        assert (len(past) > 0) == (step > 0)
        assert len(past) <= 8
        for ys in past:  # each was the response of some earlier step
            assert min(np.abs(np.array(ys) - earlier.mean[:, k]).max() for _, earlier, _ in told[:step]) < close["atol"]
        density = one.page.locator("#densities figure").nth(slot)
        assert density.locator("figcaption").inner_text() == f"{CONTROLLED[k]} now [m]"
        words = density.locator("svg").get_attribute("aria-label").split(" ± ")
        expected = [response.mean[0, k], response.std[0, k]]
        assert_allclose([number(word) for word in words], expected, rtol=0.06, atol=close["atol"])
    for kind, mean, std in (
        ("phase", estimate.phase, estimate.phase_std),
        ("tempo", estimate.phase_velocity, estimate.phase_velocity_std),
    ):
        label = one.page.locator(f"[data-small={kind}] svg").get_attribute("aria-label").split(" ± ")
        assert_allclose([number(word) for word in label], [mean, std], rtol=0.06, atol=1e-4)
    time = float(episode.times[step])
    length = float(episode.times[-1])
    assert one.text("#moment") == f"{time:.3f} of {length:.2f} s, step {step + 1} of {len(told)}"
    state = one.text("#state")
    assert state.startswith(f"phase {estimate.phase:.3f} ± {estimate.phase_std:.3f}")
    assert state.endswith(estimate.status.value)


def test_the_cursor_the_reading_and_what_had_been_seen_stand_where_they_belong(one, told, played):
    _, episode = played
    one.show("#observed")
    for step in (0, 9, 24, len(told) - 1):
        one.to(step)
        time, before = float(episode.times[step]), float(episode.times[max(step - 1, 0)])
        for name in ("observed-0", "observed-1", "controlled-0"):
            (line,) = one.over(name, "line")
            assert abs(line["left"] + line["width"] / 2 - one.place(name, time)[0]) < 1.5
        k = channel_of(one, "observed", 0)
        points, value = one.over("observed-0", "point"), episode.values[step, k]
        assert len(points) == (not np.isnan(value))  # nothing was seen at step 24
        for box in points:
            x, y = one.place("observed-0", time, float(value))
            assert abs(box["left"] + box["width"] / 2 - x) < 1.5
            assert abs(box["top"] + box["height"] / 2 - y) < 1.5
        strips = one.over("observed-0", "seen")
        assert len(strips) == (0, 1, 2)[min(step, 2)]
        if step > 1:  # until the sample before, and since
            (left, middle), (again, right) = ((s["left"], s["right"]) for s in strips)
            expected = [one.place("observed-0", t)[0] for t in (0.0, before, before, time)]
            assert_allclose([left, middle, again, right], expected, atol=1.5)


def test_curves_are_what_was_seen_happened_and_was_inferred(one, told, played):
    _, episode = played
    for slot in range(4):
        k = channel_of(one, "observed", slot)
        line, values = one.data(f"observed-{slot}:line"), episode.values[:, k]
        assert_allclose(line["x"], episode.times, atol=1e-5)
        assert_allclose(line["y"], values, atol=1e-4 * span(values))
        k = len(OBSERVED) + channel_of(one, "controlled", slot)
        truth = one.data(f"controlled-{slot}:truth")
        assert_allclose(truth["y"], episode.values[:, k], atol=1e-4 * span(episode.values[:, k]))
    fields = {"phase": "phase", "tempo": "phase_velocity", "likelihood": "log_likelihood"}
    for name, field in fields.items():
        curve = np.array([getattr(estimate, field) for estimate, _, _ in told])
        assert_allclose(one.data(f"{name}:run-0")["y"], curve, rtol=1e-6, atol=1e-6)
        if name != "likelihood":
            std = np.array([getattr(estimate, f"{field}_std") for estimate, _, _ in told])
            band = one.data(f"{name}:band")
            assert_allclose(band["low"], curve - NINETY * std, rtol=1e-5, atol=1e-6)
            assert_allclose(band["high"], curve + NINETY * std, rtol=1e-5, atol=1e-6)
    assert_allclose(one.data("phase:expected")["y"], episode.phases, atol=1e-6)
    troubles = one.data("phase:troubles")
    assert_allclose(troubles["left"].min(), episode.times[20], atol=1e-5)
    assert_allclose(troubles["right"].max(), episode.times[28], atol=1e-5)


def test_a_table_beside_a_figure_follows_while_it_is_open(one, told, played):
    _, episode = played
    one.to(3)
    for kind in ("observed-0", "controlled-0", "phase"):
        one.page.locator(f"[data-plot='{kind}'] details.beside summary").click()
    for step in (3, 12):
        one.to(step)
        estimate, response, _ = told[step]
        k = channel_of(one, "controlled", 0)
        head, *rows = one.table("[data-plot='controlled-0'] .beside table")
        assert head == ["time [s]", "phase", "response", "90 % ±", "happened"]
        every = max(SAMPLES // 12, 1)
        shown = np.array([[number(cell) for cell in row] for row in rows])
        expected = np.stack([response.times, response.phases, response.mean[:, k], NINETY * response.std[:, k]], axis=1)
        assert_allclose(shown[:, :4], expected[::every], rtol=6e-3, atol=2e-4)
        rows = one.table("[data-plot='phase'] .beside table")[1:]
        own = next(row for row in rows if abs(number(row[0]) - episode.times[step]) < 1e-3)
        assert_allclose([number(own[1]), number(own[2])], [estimate.phase, estimate.phase_std], rtol=6e-3)
        assert own[3] == estimate.status.name.lower().replace("_", " ")
        assert any(
            abs(number(row[0]) - episode.times[step]) < 1e-3
            for row in one.table("[data-plot='observed-0'] .beside table")[1:]
        )
    for kind in ("observed-0", "controlled-0", "phase"):
        one.page.locator(f"[data-plot='{kind}'] details.beside summary").click()


def test_across_the_phase_all_figures_are_linked_too(one, told):
    step = 12
    one.show("#controlled")
    one.to(step)
    one.page.locator("#axis").select_option("phase")
    one.settle()
    try:
        phases = np.array([estimate.phase for estimate, _, _ in told])
        _, response, _ = told[step]
        for name in ("observed-0", "controlled-0", "phase", "likelihood"):
            low, high = one.range(name)
            assert -0.05 < low <= 0 < 1 <= high < 1.05
        assert_allclose(one.data("observed-0:line")["x"], phases, atol=1e-5)
        assert_allclose(one.data("likelihood:run-0")["x"], phases, atol=1e-5)
        assert_allclose(one.data("controlled-0:response")["x"], response.phases, atol=1e-4)
        (line,) = one.over("observed-0", "line")
        assert abs(line["left"] + line["width"] / 2 - one.place("observed-0", phases[step])[0]) < 1.5
    finally:
        one.page.locator("#axis").select_option("time")
        one.settle()
    assert one.range("phase")[1] > 1.5


def test_zooming_one_figure_zooms_all(one):
    one.show("#observed")
    before = one.range()
    box = one.page.locator("[data-plot='observed-0'] .bk-Figure").bounding_box()
    one.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    one.page.keyboard.down("Control")
    one.page.mouse.wheel(0, -300)
    one.page.keyboard.up("Control")
    one.page.wait_for_function(f"{VIEW('observed-0')}.frame.x_range.end < {before[1] - 1e-3}")
    one.settle()
    low, high = one.range()
    assert before[0] < low < high < before[1]
    for name in ("observed-3", "controlled-0", "phase", "tempo", "likelihood"):
        assert one.range(name) == (low, high)
    one.page.locator("#axis").select_option("phase")
    one.page.locator("#axis").select_option("time")  # begins anew
    one.settle()
    assert one.range() == before


def test_other_channels_can_be_chosen(one, told, played):
    one.show("#controlled")
    one.to(10)
    one.page.locator("#controlled .chooser summary").click()
    shown = {channel_of(one, "controlled", slot) for slot in range(4)}
    other = next(k for k in range(len(CONTROLLED)) if k not in shown)
    before = channel_of(one, "controlled", 1)
    select = one.page.locator("#controlled .chooser select").nth(1)
    assert select.locator("option").all_inner_texts() == CONTROLLED
    select.select_option(str(other))
    one.settle()
    assert channel_of(one, "controlled", 1) == other
    _, response, _ = told[10]
    values = played[1].values[:, len(OBSERVED) + other]
    assert_allclose(one.data("controlled-1:response")["y"], response.mean[:, other], atol=1e-4 * span(values))
    assert_allclose(one.data("controlled-1:truth")["y"], values, atol=1e-4 * span(values))
    assert one.page.locator("#densities figcaption").nth(1).inner_text().startswith(CONTROLLED[other])
    assert "4 of 6" in one.text("#controlled h2")
    select.select_option(str(before))


# --------------------------------------------------------------------------------------------------------- correlations


def fields(one, selector):
    """Names across, names down, and the values of a table of correlations."""
    head, *rows = one.table(f"{selector} table.matrix")
    return head[1:], [row[0] for row in rows], np.array([[number(cell) for cell in row[1:]] for row in rows])


def test_correlations_open_into_those_of_the_weights(one, told, played):
    model, _ = played
    one.to(14)
    one.page.locator("#correlation").scroll_into_view_if_needed()
    one.settle()
    estimate, _, belief = told[14]
    rows = Lens.of(model).directions
    seen_along = rows.T @ rows  # what the few directions show of the weights
    cov = seen_along @ belief.weights_cov @ seen_along
    across, down, values = fields(one, "#correlation > .scroll")
    assert across == down
    names = list(model.coordinates.names)
    features = np.array([names.index(name) for name in across])
    makes = np.stack(
        [model.layout.predict(np.array([estimate.phase]), unit, features)[0] for unit in np.eye(model.layout.size)]
    )
    read = makes.T @ cov @ makes
    std = np.sqrt(np.diag(read))
    assert_allclose(values, read / np.outer(std, std), atol=0.056)
    pair = (1, len(across) - 1)
    one.page.locator("#correlation > .scroll tbody tr").nth(pair[0]).locator("td").nth(pair[1]).click()
    one.settle()
    assert across[pair[0]] in one.text("#weights h3")
    assert across[pair[1]] in one.text("#weights h3")
    for step in (14, 30):
        one.to(step)
        one.page.locator("#weights").scroll_into_view_if_needed()
        one.settle()
        cov = seen_along @ told[step][2].weights_cov @ seen_along
        std = np.sqrt(np.diag(cov))
        both = (cov / np.outer(std, std))[
            model.layout.slices[features[pair[0]]], model.layout.slices[features[pair[1]]]
        ]
        assert_allclose(fields(one, "#weights")[2], both, atol=0.056)
    one.page.locator("#correlation > .scroll tbody tr").nth(2).locator("td").nth(3).focus()
    one.press("Enter")
    assert across[2] in one.text("#weights h3")


# -------------------------------------------------------------------------------------------------- findings and events


def test_what_strikes_and_events_lead_to_their_moment(one, told, played):
    _, episode = played
    one.to(0)
    item = one.page.locator("#findings li", has_text="No observed channel was read")
    item.locator("button").click()
    one.settle()
    assert one.step == 19  # the last that was seen
    row = one.page.locator("#events tr", has_text="nothing seen").first
    assert number(row.locator("button").inner_text()) == pytest.approx(episode.times[20], abs=1e-3)
    row.locator("button").click()
    one.settle()
    assert one.step == 20
    assert told[20][0].status.value in one.text("#state")


# ------------------------------------------------------------------------------------------------------------- compared


def test_runs_are_compared_over_one_axis(opened, told, played):
    _, episode = played
    three = opened("three")
    page = three.page
    assert page.locator("#run option").all_inner_texts() == ["episode 6 (bip)", "episode 6 (ebip)", "slow (bip)"]
    now = np.array([response.mean[0] for _, response, _ in told])
    k = channel_of(three, "compared", 0)
    three.show("#compared")
    runs = [three.data(f"compared-0:run-{i}") for i in range(3)]
    assert_allclose(runs[0]["y"], now[:, k], atol=1e-4 * span(now[:, k]))
    assert np.abs(runs[1]["y"] - now[:, k]).max() > 1e-3
    assert_allclose(runs[2]["x"][-1], 1.4 * episode.times[-1], rtol=1e-5)
    assert three.range("compared-1")[1] > 1.4 * episode.times[-1] - 0.05  # the axis holds all of them
    page.evaluate("Bokeh.documents[0].get_model_by_name('compared-0').x_range.setv({start: 0.5, end: 1.0})")
    three.settle()
    assert {three.range(name) for name in ("compared-0", "compared-3", "observed-0", "phase")} == {(0.5, 1.0)}
    three.to(20)
    page.locator("#run").select_option("2")  # the same time in another run
    three.settle()
    assert three.step == int(np.flatnonzero(1.4 * episode.times <= episode.times[20] + 1e-9)[-1])
    head, *rows = three.table("#compared .tables table")
    assert [row[0] for row in rows] == ["episode 6 (bip)", "episode 6 (ebip)", "slow (bip)"]
    error = (now - episode.values[:, len(OBSERVED) :]) / played[0].spread[len(OBSERVED) :]
    assert number(rows[0][1]) == pytest.approx(np.mean(error**2), rel=6e-3)
    assert "late by [s]" in head
    page.locator("#run").select_option("0")
    three.settle()
    assert abs(three.step - 20) <= 1


# ----------------------------------------------------------------------------------------------- looks and small places


def colour(report, expression):
    return report.page.evaluate(expression)


BACK = "getComputedStyle(document.body).backgroundColor"
AXIS = "Bokeh.documents[0].get_model_by_name('phase').below[0].major_label_text_color"


def brightness(text):
    if text.startswith("#"):
        return sum(int(text[i : i + 2], 16) for i in (1, 3, 5)) / 765
    return sum(map(int, re.findall(r"\d+", text)[:3])) / 765


def test_it_is_dark_where_that_is_preferred_and_can_be_turned(opened):
    for context, dark in (({}, False), (DARK, True)):
        report = opened("one", **context)
        for turned in (dark, not dark):
            assert (brightness(colour(report, BACK)) < 0.3) == turned
            assert (brightness(colour(report, AXIS)) > 0.6) == turned
            assert report.page.locator("#night").get_attribute("aria-pressed") == str(turned).lower()
            report.page.locator("#night").click()
            report.settle()


WIDER = """() => Array.from(document.querySelectorAll("body *")).filter(e => !e.closest(".scroll") && !e.closest("svg")
    && e.getClientRects().length && e.getBoundingClientRect().right > innerWidth + 1).map(e => e.outerHTML)"""


@pytest.mark.parametrize("name", ["one", "three", "hostile"])
def test_at_400_pixels_nothing_is_wider_than_the_page(name, opened):
    report = opened(name, viewport=NARROW)
    for summary in report.page.locator("details.beside summary:visible").all()[:6]:
        summary.click()
    report.settle()
    assert report.page.evaluate("document.documentElement.scrollWidth") <= 400
    assert report.page.evaluate(WIDER) == []
    assert report.page.evaluate(f"{VIEW('observed-0')}.frame.bbox.width") > 250  # and can be read


# ------------------------------------------------------------------------------------------------------------ bad names


def test_names_are_text_and_nothing_is_executed(opened):
    report = opened("hostile")
    page = report.page
    for i in range(3):
        report.to(5 * i)
    assert page.title() == page.locator("#title").text_content() == f"{HOSTILE[3]} </title>{HOSTILE[1]} {HOSTILE[2]}"
    headings = page.locator("#observed figcaption, #controlled figcaption").all_text_contents()
    assert [text for text in headings if text] == [f"{name} [{HOSTILE[0]}]" for name in HOSTILE]
    rows = report.table("#events table")
    for word in HOSTILE:
        said = f"{word} → {word}: {word}"
        assert any(row[1:] == [word, said] for row in rows)
    assert page.locator("#findings .remark").all_text_contents() == HOSTILE
    assert fields(report, "#correlation > .scroll")[0] == HOSTILE
    page.locator("#correlation > .scroll tbody tr").nth(0).locator("td").nth(1).click()
    assert HOSTILE[0] in page.locator("#weights h3").text_content()
    assert page.evaluate(
        "[document.images.length, document.querySelectorAll('iframe, object, embed, mjx-container').length]"
    ) == [0, 0]
    assert not any(text.startswith("alert") for text in page.locator("script").all_text_contents())


def test_the_page_itself_forbids_to_contact_anyone(chromium, pages):
    context = chromium.new_context()
    page = context.new_page()
    page.goto((pages / "one.html").as_uri())
    page.wait_for_selector("html[data-ready=true]")
    with socket.create_server(("127.0.0.1", 0)) as server:
        refused = page.evaluate(
            """async home => {
                const refused = [];
                const add = (tag, told) => document.body.append(Object.assign(document.createElement(tag), told));
                document.addEventListener("securitypolicyviolation", event => refused.push(event.effectiveDirective));
                await fetch(home, {signal: AbortSignal.timeout(1000)}).catch(() => 0);  // nobody answers
                add("img", {src: `${home}a.png`});
                add("script", {src: `${home}a.js`});
                add("link", {rel: "stylesheet", href: `${home}a.css`});
                add("form", {action: home, method: "post"});
                document.forms[0].submit();
                await new Promise(done => setTimeout(done, 100));
                return refused.sort();
            }""",
            f"http://127.0.0.1:{server.getsockname()[1]}/",
        )
        server.settimeout(0.1)
        with suppress(TimeoutError):
            while True:  # it may connect ahead of what it then refuses to ask, but nothing may be asked
                with server.accept()[0] as caller, suppress(TimeoutError):
                    caller.settimeout(0.1)
                    assert caller.recv(1) == b""
    context.close()
    assert refused == ["connect-src", "form-action", "img-src", "script-src-elem", "style-src-elem"]


# -------------------------------------------------------------------------------------------------------------- packing


def test_what_the_page_unpacks_is_what_was_packed(chromium, rng):
    packing = Packing()
    wide = rng.standard_normal((40, 3, 5)) * [1e-6, 1.0, 1e9, 1.0, 0.0] + [0.0, 1e6, 0.0, -3.0, 7.0]
    wide[rng.random(wide.shape) < 0.2] = np.nan
    wide[..., 3] = np.nan
    packing.put("odd", np.arange(3), "u1")  # what comes next begins at a multiple of its size
    packing.put_quantised("wide", wide)
    packing.put("signed", np.arange(-127, 128), "i1")
    packing.put("counts", [0, 2**32 - 1], "u4")
    floats = np.array([0.1, -np.inf, np.nan, 3e38])
    packing.put("floats", floats)
    packing.put_quantised("nothing", np.full((4, 2), np.nan))
    page = chromium.new_page()
    page.add_script_tag(content=(HERE / "numbers.js").read_text(encoding="utf-8"))
    unpacked = page.evaluate(
        """([text, contents]) => { const buffer = decode(text), all = {};
            for (const [name, told] of Object.entries(contents)) {
                const numbers = new Numbers(buffer, told);
                all[name] = Array.from({length: numbers.raw.length}, (_, i) => numbers.at(i));
                const list = (length, values) => Array.from({length}, (_, i) => Array.from(values(i)));
                all[`${name} by columns`] = list(numbers.columns, k => numbers.column(k));
                all[`${name} by rows`] = list(told.shape[0], i => numbers.row(i));
            }
            return all; }""",
        [packing.text, packing.contents],
    )
    half = (np.nanmax(wide, axis=(0, 1), initial=-1e300) - np.nanmin(wide, axis=(0, 1), initial=1e300)) / STEPS / 2
    for found in (
        np.array(unpacked["wide"]).reshape(wide.shape),
        np.array(unpacked["wide by columns"]).T.reshape(wide.shape),
        np.array(unpacked["wide by rows"]).reshape(wide.shape),
    ):
        assert (np.isnan(found) == np.isnan(wide)).all()
        known = ~np.isnan(wide)
        assert (np.abs(found - wide) <= np.where(half > 0, half, 0) * 1.0001 + 1e-12 * np.abs(wide))[known].all()
    assert unpacked["odd"] == [0, 1, 2]
    assert unpacked["signed"] == list(range(-127, 128))
    assert unpacked["counts"] == [0, 2**32 - 1]
    assert_allclose(unpacked["floats"], floats.astype(np.float32))
    assert np.isnan(unpacked["nothing"]).all()
    page.close()


def test_a_thinned_curve_keeps_its_peaks_and_its_gaps(chromium, rng):
    times, values = np.arange(20_000) / 60, np.cumsum(rng.standard_normal(20_000))
    values[[77, 15_000]] = 900.0, -900.0
    values[4_000:4_100] = np.nan
    page = chromium.new_page()
    page.add_script_tag(content=(HERE / "numbers.js").read_text(encoding="utf-8"))
    thinned = "([x, y, from, until]) => { const {x: xs, y: ys} = thin(x, y, from, until, 500); return [xs, ys]; }"
    x, y = (np.array(part) for part in page.evaluate(thinned, [times.tolist(), values.tolist(), 0, 400]))
    assert 500 <= len(x) <= 1_500
    assert (np.diff(x) > 0).all()
    assert (np.nanmax(y), np.nanmin(y)) == (900.0, -900.0)
    assert np.isnan(y[(x >= times[4_000]) & (x < times[4_100])]).any()
    at = dict(zip(times, values, strict=True))
    assert all(np.array_equal(at[t], v, equal_nan=True) for t, v in zip(x, y, strict=True))
    x, y = (np.array(part) for part in page.evaluate(thinned, [times.tolist(), values.tolist(), 100.0, 110.0]))
    within = (times >= 100) & (times <= 110)
    assert set(times[within]) <= set(x)  # looked at closely, all of it
    page.close()
