"""The page of a long run: how large it is, how soon it opens, and how smoothly one looks through it, in a real browser.

Ten minutes at 60 Hz with 30 channels, one interaction after the other, recorded as a live run is. Beside it stands the
least that a bokeh page can be: one curve, and a slider that moves a mark. The same browser opens both, by turns.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import one_thread  # noqa: F401 - before numpy

# isort: split
import numpy as np
from sizes import DURATION, Size, make_model

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import browser, watched

from inphase.cli import main as inphase
from inphase.recording import RecordedEvent
from inphase.replay import RESET, provenance_of
from inphase.runtime.recorder import Recorder

RATE, RESPOND_EVERY = 60.0, 3  # [1/s]; steps
CHANNELS, BASIS, DEMONSTRATIONS = 30, 15, 24
LARGEST, SLOWEST = 15.0, 3.0  # [MB], [s]: the wish of the issue
STEPS = 60  # that are looked at
OPENED = 5  # times

LOOK = """async ([jumps]) => {
  const slider = document.querySelector("input[type=range]");
  const most = Number(slider.max), frame = () => new Promise(done => requestAnimationFrame(done));
  await frame(); await frame();
  const taken = [];
  for (let i = 1; i <= jumps; i++) {
    const begun = performance.now();
    slider.value = Math.round(most * (0.2 + 0.6 * i / jumps));
    slider.dispatchEvent(new Event("input", {bubbles: true}));
    await frame();  // what the input asked for is done in this frame, and bokeh paints in the next
    await frame();
    taken.push(performance.now() - begun);
  }
  return taken;
}"""

TRIVIAL = """<!DOCTYPE html><meta charset="utf-8"><link rel="icon" href="data:,"><title>trivial</title>
<input type="range" min="0" max="1000" value="0">{place}<script>{bokeh}</script><script>{script}</script><script>
const wait = () => {{
  if (!(Bokeh.documents.length && Bokeh.documents[0].is_idle)) return setTimeout(wait, 10);
  const mark = Bokeh.documents[0].get_model_by_name("mark");
  document.querySelector("input").oninput = event => {{ mark.location = Number(event.target.value); }};
  document.documentElement.dataset.ready = "true";
}};
wait();
</script>"""


def record(target: Path, seconds: float) -> None:
    """A run as `inphase live` would have recorded it, with the extended Kalman filter."""
    rng = np.random.default_rng(0)
    model = make_model(Size(CHANNELS, BASIS, DEMONSTRATIONS), rng)
    session, observed = model.session("bip"), len(model.observed)
    with Recorder(
        target, model.channels, provenance_of(model, "bip"), model=model, name="long", capacity=10**7
    ) as recorder:
        interaction = -1
        for i in range(int(seconds * RATE)):
            at = i / RATE
            if int(at // DURATION) != interaction:
                interaction = int(at // DURATION)
                weights = model.prior.draw(1, rng)[0]
                if i:
                    recorder.put_event(RecordedEvent(at - 0.5 / RATE, RESET, "the next interaction"))
                    session.reset()
            values = model.predict([min((at % DURATION) / DURATION, 1.0)], weights)[0, :observed]
            values = values + 0.02 * rng.standard_normal(observed)
            recorder.put_step(values, session.observe(at, values))
            if i % RESPOND_EVERY == 0:
                recorder.put_response(at, session.respond(samples=20))


def trivial(target: Path) -> None:
    """The least page."""
    from bokeh.embed import components
    from bokeh.models.annotations import Span
    from bokeh.plotting import figure
    from bokeh.resources import Resources

    made = figure(width=600, height=300)
    made.line(np.arange(1000), np.sin(np.arange(1000) / 50))
    made.add_layout(Span(location=0, dimension="height", name="mark"))
    script, place = components(made, wrap_script=False)
    code = "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)
    target.write_text(TRIVIAL.format(place=place, bokeh=code, script=script), encoding="utf-8")


def look(started: Any, path: Path) -> tuple[float, np.ndarray]:
    """How long a page took to be ready [s], and each of the steps [ms]."""
    with watched(started) as seen:
        begun = time.perf_counter()
        seen.page.goto(f"file://{path}")
        seen.page.wait_for_selector("html[data-ready=true]", timeout=60_000)
        opened = time.perf_counter() - begun
        return opened, np.array(seen.page.evaluate(LOOK, [STEPS]))


def timed(work: Callable[[], object]) -> float:
    """How long it took [s]."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def measure(folder: Path, seconds: float, times: int) -> dict[str, float]:
    """All figures; times are medians over the times a page was opened."""
    run, page, least = folder / "long.mcap", folder / "report.html", folder / "trivial.html"
    record(run, seconds)
    arguments = ["report", str(run), "-o", str(page)]
    made = timed(lambda: inphase(arguments))
    quick = timed(lambda: inphase([*arguments[:-1], str(folder / "quick.html"), "--quick"]))
    trivial(least)
    with browser() as started:
        turns = [(look(started, least), look(started, page)) for _ in range(times)]
    opened = np.array([[first[0], second[0]] for first, second in turns])
    steps = np.array([[np.median(first[1]), np.median(second[1])] for first, second in turns])
    late = np.quantile(np.concatenate([second[1] for _, second in turns]), 0.95)
    return {
        "run [MB]": run.stat().st_size / 1e6,
        "made in [s]": made,
        "made in, --quick [s]": quick,
        "page [MB]": page.stat().st_size / 1e6,
        "trivial page [MB]": least.stat().st_size / 1e6,
        "opens in [s]": float(np.median(opened[:, 1])),
        "opens, over the trivial page": float(np.median(opened[:, 1] / opened[:, 0])),
        "a step [ms]": float(np.median(steps[:, 1])),
        "a step, 95th percentile [ms]": float(late),
        "a step, over the trivial page": float(np.median(steps[:, 1] / steps[:, 0])),
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="of the run")
    parser.add_argument("--quick", action="store_true", help="a run of 12 seconds, opened once")
    parser.add_argument("--json", action="store_true", help="for a machine")
    parser.add_argument("--keep", type=Path, help="leave run and pages in this folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = measure(folder, *((12.0, 1) if arguments.quick else (arguments.seconds, OPENED)))
    if arguments.json:
        print(json.dumps(found))
        return
    for name, value in found.items():
        print(f"{name:32s}{value:10.3g}")
    print(f"wanted: a page under {LARGEST:g} MB that opens in under {SLOWEST:g} s")


if __name__ == "__main__":
    main()
