"""The studio less its page: command lines, who runs them, what is in a folder, and a server for one computer alone."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import re
import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interactions import CONTROLLED, OBSERVED
from studios import studio, write

import inphase
from inphase.channels import match
from inphase.cli.console import waiting, working
from inphase.errors import ModelFileError, OptionError
from inphase.io import Table
from inphase.studio import worker
from inphase.studio.command import Command
from inphase.studio.desk import Choice, Desk
from inphase.studio.export_tab import save_copy
from inphase.studio.figures.episode import broken, draw_episode, gaps, groups, isolated, thinned
from inphase.studio.figures.overlay import Overlay, draw_overlay
from inphase.studio.folder import look
from inphase.studio.quality import Quality
from inphase.studio.roles import guess, patterns, words
from inphase.studio.text import as_html, typed
from inphase.studio.worker import Outcome, Worker

BIN = Path(sys.executable).parent
MARKUP = "<img src=x onerror=alert(1)> 'a' \"b\" $HOME `id`"


# ------------------------------------------------------------------------------------------------------ command lines


def test_options_are_left_out_where_they_say_nothing():
    command = Command.of(
        "fit",
        "-a.csv",
        "b",
        options={
            "observed": ("x", "y z"),
            "json": True,
            "quick": False,
            "seed": 0,
            "basis": None,
            "angle": (),
            "o": "c",
        },
    )
    expected = ("fit", "./-a.csv", "b", "--observed", "x", "y z", "--json", "--seed", "0", "-o", "c")
    assert command.arguments == expected


@given(st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])), min_size=1))
def test_what_is_shown_says_what_is_run(arguments):
    command = Command(tuple(arguments))
    assert shlex.split(command.shown) == ["inphase", *arguments]
    assert command.run_as == [sys.executable, "-m", "inphase.cli", *arguments]


def ran(folder: Path, command: Command) -> Outcome:
    """How it ends, run as the studio does."""
    return asyncio.run(seen_through(folder, command))


async def seen_through(folder: Path, command: Command, then: Callable[[Worker], None] = lambda worker: None) -> Outcome:
    ended: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
    runs = Worker(folder, lambda call: call())
    runs.run(command, ended.set_result)
    then(runs)
    return await asyncio.wait_for(ended, 60)


def test_the_shown_command_typed_in_a_shell_does_the_same(tmp_path):
    name = MARKUP.replace("/", "")
    write(tmp_path, [name, *"bcd"], episodes=3)
    options = {"observed": [name, "b"], "drop": [f"episode_1={MARKUP}"], "json": True}
    command = Command.of("inspect", ".", options=options)
    outcome = ran(tmp_path, command)
    assert outcome.fine
    assert outcome.error == ""
    notes = tmp_path / "inphase-notes.json"
    noted = notes.read_bytes()
    assert json.loads(noted)["episodes"] == {"episode_1": {"use": False, "reason": MARKUP}}
    notes.unlink()
    environment = {
        **os.environ,
        "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    typed_in = subprocess.run(
        ["bash", "-c", command.shown], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert typed_in.stdout == outcome.output
    assert notes.read_bytes() == noted


# ------------------------------------------------------------------------------------------------------------- worker


@dataclass(frozen=True)
class Script(Command):
    """A program of Python in the place of inphase."""

    @property
    def run_as(self) -> list[str]:
        return [sys.executable, "-c", *self.arguments]


def test_progress_is_told_and_is_no_part_of_what_was_said(tmp_path):
    told: list[tuple[str, float | None]] = []
    code = (
        "import sys, time\n"
        "for line in ['doing a thing', 'progress 0.25', 'progress what', 'hello', 'progress 7']:\n"
        "    print(line, file=sys.stderr, flush=True); time.sleep(0.05)\n"
        "print('out'); sys.exit(3)"
    )

    async def run() -> Outcome:
        ended: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        runs = Worker(tmp_path, lambda call: call())
        runs.run(Script((code,)), ended.set_result, lambda job: told.append((job.doing, job.share)))
        return await asyncio.wait_for(ended, 60)

    outcome = asyncio.run(run())
    assert (outcome.code, outcome.output, outcome.said, outcome.error) == (3, "out\n", "hello\n", "hello")
    assert told == sorted(told, key=lambda pair: pair[1] or 0.0)
    assert told[-1] == ("a thing", 1.0)
    assert ("a thing", 0.25) in told


@pytest.mark.parametrize(
    ("said", "error"),
    [
        ("a warning\ninphase: no such file\n", "inphase: no such file"),
        ("╭─ Unrecognized options ─╮\n│ Unrecognized: --o │\n╰──────╯\n", "Unrecognized options"),
        ("Traceback (most recent call last):\n  File\nValueError: no\n", "ValueError: no"),
        ("", "ended with exit code 2"),
    ],
)
def test_an_error_is_one_line(said, error):
    assert Outcome(Command(("fit",)), 2, "", said).error == error


def test_what_is_stopped_ends_with_all_it_has_started(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "GRACE", 0.2)
    child = "import time; open('child', 'w').close(); time.sleep(1); open('outlived', 'w').close()"
    code = (
        "import signal, subprocess, sys, time\n"
        "for sent in (signal.SIGINT, signal.SIGTERM): signal.signal(sent, signal.SIG_IGN)\n"
        f"subprocess.Popen([sys.executable, '-c', {child!r}])\n"
        "time.sleep(60)"
    )

    async def run() -> Outcome:
        ended: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        runs = Worker(tmp_path, lambda call: call())
        job = runs.run(Script((code,)), ended.set_result)
        while not (tmp_path / "child").exists():
            await asyncio.sleep(0.02)
        job.stop()
        return await asyncio.wait_for(ended, 60)

    outcome = asyncio.run(run())
    assert (outcome.stopped, outcome.error) == (True, "stopped")
    time.sleep(1.1)
    assert not (tmp_path / "outlived").exists()


def test_a_command_is_asked_to_stop_as_by_ctrl_c(tmp_path):
    code = "import time\ntry: open('begun', 'w').close(); time.sleep(60)\nexcept KeyboardInterrupt: print('tidied up')"

    async def run() -> Outcome:
        ended: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        runs = Worker(tmp_path, lambda call: call())
        job = runs.run(Script((code,)), ended.set_result)
        while not (tmp_path / "begun").exists():
            await asyncio.sleep(0.02)
        job.stop()
        return await asyncio.wait_for(ended, 60)

    assert asyncio.run(run()).output == "tidied up\n"


def test_what_is_only_being_started_ends_too(tmp_path):
    async def run() -> None:
        runs = Worker(tmp_path, lambda call: call())
        runs.run(Script(("import time; time.sleep(5)",)), lambda outcome: None)
        await asyncio.sleep(0)
        await runs.closed()
        assert running_in(tmp_path) == []

    asyncio.run(run())


def test_a_folder_that_is_gone_is_an_outcome(tmp_path):
    assert "cannot be run" in ran(tmp_path / "none", Command(("fit",))).error


def test_commands_tell_a_program_how_far_they_are(monkeypatch, capsys):
    monkeypatch.setenv("INPHASE_PROGRESS", "plain")
    with waiting("reading"), working("learning") as tell:
        assert tell is not None
        tell(0.5)
    assert capsys.readouterr().err == "doing reading\ndoing learning\nprogress 0.500\n"


# ---------------------------------------------------------------------------------------------------- what is chosen


def test_what_is_in_a_folder(tmp_path):
    for name in [
        "b/e10.csv",
        "b/e9.npz",
        "a.CSV",
        ".hidden.csv",
        ".cache/x.csv",
        "m.inphase",
        "b/old.mcap",
        "new.mcap",
    ]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    os.utime(tmp_path / "b/old.mcap", (1, 1))
    (tmp_path / "1/2/3/4/5").mkdir(parents=True)
    (tmp_path / "1/2/3/4/deep.csv").touch()
    (tmp_path / "1/2/3/4/5/deeper.csv").touch()
    (tmp_path / "gone.csv").symlink_to(tmp_path / "nowhere")
    found = look(tmp_path)
    expected = {".": ("a.CSV",), "b": ("b/e9.npz", "b/e10.csv"), "1/2/3/4": ("1/2/3/4/deep.csv",)}
    assert found.episodes == expected
    assert found.models == ("m.inphase",)
    assert found.runs == ("new.mcap", "b/old.mcap")
    assert found.whole


def desk_of(folder: Path, choice: Choice | None = None) -> Desk:
    return Desk(folder, Worker(folder, lambda call: call()), folder, "/token/pages", choice)


def test_episodes_are_called_as_every_command_calls_them(run, tmp_path, monkeypatch):
    write(tmp_path / "a", episodes=2)
    write(tmp_path / "b", episodes=1)
    desk = desk_of(tmp_path)
    assert desk.choice.recordings == ("a",)
    desk.choose(recordings=("a", "b"))
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(*Command.of("inspect", *desk.choice.recordings, options={"json": True}).arguments)
    assert code == 0
    assert (
        [episode["name"] for episode in json.loads(out)["episodes"]]
        == list(desk.episodes)
        == ["a/episode_0", "episode_1", "b/episode_0"]
    )


def test_notes_that_cannot_be_used_leave_a_table(tmp_path):
    write(tmp_path, episodes=1)
    quality = Quality(desk_of(tmp_path))
    assert quality.table()["said"] == [""]
    (tmp_path / "inphase-notes.json").write_text(
        '{"version": 1, "episodes": {"episode_0": {"use": false, "from": 0.5}}}'
    )
    assert quality.table()["said"] == ["left out"]
    (tmp_path / "inphase-notes.json").write_text("{")
    assert quality.table()["said"] == [""]


def test_those_who_listen_are_told_what_they_listen_to(tmp_path):
    write(tmp_path, episodes=1)
    desk = desk_of(tmp_path)
    told: list[str] = []
    for what in ("model", "observed controlled", "episodes", "models"):
        desk.listen(what, lambda what=what: told.append(what))
    desk.choose(model="a.inphase", observed=("x",))
    desk.choose(model="a.inphase")
    assert told == ["model", "observed controlled"]
    (tmp_path / "b.inphase").touch()
    desk.look()
    desk.look()
    assert told[2:] == ["models"]


NAMES = st.lists(st.text("ab_1*", min_size=1, max_size=5), min_size=1, max_size=12, unique=True)


@given(st.data(), NAMES)
def test_patterns_fit_what_was_chosen_and_nothing_else(data, names):
    chosen = {name for name in names if data.draw(st.booleans())}
    found = patterns(chosen, names)
    assert {names[i] for i in match(found, names)} == chosen
    assert len(found) <= len(chosen)


def test_patterns_are_few():
    names = [f"{side}_{axis}" for side in ("taker", "giver") for axis in "xyz"]
    assert patterns(names[:3], names) == ("taker_*",)
    assert patterns(names[:2], names) == ("taker_x", "taker_y")


def test_roles_are_guessed_from_a_model_of_these_channels(tmp_path):
    write(tmp_path, episodes=3)
    assert guess(desk_of(tmp_path))["observed"] == ()
    (tmp_path / "a.inphase").write_bytes(b"no model")
    dataset = inphase.load(tmp_path, observed=OBSERVED, controlled=CONTROLLED)
    inphase.fit(dataset, calibrate=False).save(tmp_path / "b.inphase")
    guessed = guess(desk_of(tmp_path))
    assert (guessed["observed"], guessed["controlled"]) == (OBSERVED, CONTROLLED)


def test_names_are_taken_apart_as_by_a_shell():
    assert words("a_* 'b c'") == ("a_*", "b c")
    with pytest.raises(OptionError, match="cannot be taken apart"):
        words("'a")


def test_text_is_never_markup():
    for made in (as_html(MARKUP), typed(MARKUP)):
        assert "<img" not in made


# ------------------------------------------------------------------------------------------------------------ figures


def test_of_a_long_recording_the_extremes_and_the_gaps_are_drawn(rng):
    times = np.arange(100_000) / 60
    values = rng.standard_normal(len(times)).cumsum()
    values[5_000], values[70_001:70_400] = 1e6, np.nan
    at = thinned(times, values)
    assert len(at) < 6_000
    assert {int(np.nanargmax(values)), int(np.nanargmin(values)), 0, len(times) - 1} <= set(at)
    assert np.isnan(values[at]).any()
    assert np.array_equal(thinned(times[:50], values[:50]), np.arange(50))


def test_a_line_never_bridges_a_gap():
    times, values = np.array([0, 1, 2, 10, 11, 12.0]), np.arange(6.0)
    assert gaps(times) == [(2, 10)]
    drawn_times, drawn = broken(times, values, np.arange(6))
    between = (drawn_times > 2) & (drawn_times < 10)
    assert np.isnan(drawn[between]).all()
    assert between.any()
    assert np.array_equal(drawn[~between], values)


def test_a_reading_without_neighbours_is_a_dot():
    values = np.array([1, np.nan, 2, np.nan, 3, 4, np.nan, 5.0])
    assert isolated(values).tolist() == [0, 2, 7]


@pytest.mark.parametrize("samples", [1, 50])
@pytest.mark.parametrize("seen", [True, False])
def test_any_episode_can_be_drawn(samples, seen):
    names = tuple(f"hand_{i}" for i in range(14))
    values = np.full((samples, 14), 1.0 if seen else np.nan)
    table = Table("a", names, np.arange(samples, dtype=float), values)
    parts = groups(names)
    assert [name for part in parts.values() for name in part] == list(names)
    for title, part in parts.items():
        figure = draw_episode(table, part, title, (None, 0.5))
        ends = [getattr(axis, end) for axis in (figure.x_range, figure.y_range) for end in ("start", "end")]
        assert np.isfinite(ends).all()
        assert ends[0] < ends[1]
        assert ends[2] < ends[3]


def test_the_overlay_draws_what_was_recorded_and_what_the_basis_makes_of_it(tmp_path):
    write(tmp_path, episodes=4)
    dataset = inphase.load(tmp_path)
    overlay = Overlay.of(dataset)
    figure = draw_overlay(overlay, 1, 2, 12)
    behind, chosen, approximated = (found.data_source.data for found in figure.renderers)
    assert list(behind["name"]) == ["episode_0", "episode_1", "episode_3"] or "episode_2" not in behind["name"]
    assert np.array_equal(chosen["y"], dataset[2].values[:, 1])
    # Twelve functions follow a movement as smooth as this to its noise.
    apart = np.interp(dataset[2].phases, approximated["x"], approximated["y"]) - chosen["y"]
    assert np.abs(apart).max() < 0.02
    coarse = draw_overlay(overlay, 1, 2, 3).renderers[-1].data_source.data
    worse = np.interp(dataset[2].phases, coarse["x"], coarse["y"]) - chosen["y"]
    assert np.abs(worse).max() > 2 * np.abs(apart).max()


# ------------------------------------------------------------------------------------------------------------- export


def test_a_copy_is_the_model_and_never_in_the_place_of_a_file(tmp_path):
    write(tmp_path, episodes=3)
    dataset = inphase.load(tmp_path, observed=OBSERVED, controlled=CONTROLLED)
    model = tmp_path / "a.inphase"
    inphase.fit(dataset, calibrate=False).save(model)
    copy = save_copy(tmp_path, "a.inphase", "b.inphase", over=False)
    assert copy.read_bytes() == model.read_bytes()
    copy.write_bytes(b"other")
    with pytest.raises(FileExistsError, match="is there already"):
        save_copy(tmp_path, "a.inphase", "b.inphase", over=False)
    assert copy.read_bytes() == b"other"
    save_copy(tmp_path, "a.inphase", str(copy), over=True)
    assert copy.read_bytes() == model.read_bytes()
    with pytest.raises(OptionError, match=r"ends in \.inphase"):
        save_copy(tmp_path, "a.inphase", "b.csv", over=True)
    with pytest.raises(OptionError, match="expected the folder"):
        save_copy(tmp_path, "a.inphase", "none/b.inphase", over=False)
    (tmp_path / "no.inphase").write_bytes(b"no model")
    with pytest.raises(ModelFileError):
        save_copy(tmp_path, "no.inphase", "c.inphase", over=False)
    assert not (tmp_path / "c.inphase").exists()


# ------------------------------------------------------------------------------------------------------------- server

HOSTILE = {  # what a shell may have set for other pages of bokeh
    "BOKEH_RESOURCES": "cdn",
    "BOKEH_ALLOW_WS_ORIGIN": "*",
    "BOKEH_DEV": "true",
    "BOKEH_LOG_LEVEL": "trace",
    "BOKEH_PY_LOG_LEVEL": "trace",
    "BOKEH_SECRET_KEY": "known",
    "BOKEH_SIGN_SESSIONS": "yes",
}


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    # What it refuses it says; that its secret is not among it is seen at its end.
    with studio(tmp_path_factory.mktemp("empty"), says="(?s).*", **HOSTILE) as address:
        yield address


def asked(address: str, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Status, headers and text of an answer; the path is sent as it is."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=30)
    connection.putrequest("GET", path, skip_accept_encoding=True)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    text = "" if answer.status == 101 else answer.read().decode("utf-8", "replace")
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def test_without_the_token_there_is_nothing(address):
    token = urlsplit(address).path.strip("/")
    assert len(token) >= 32
    for start in ("", "/x", f"/{token[:-1]}", f"/{token}x", f"/{token.swapcase()}"):
        for rest in ("/", "/ws", "/metadata", "/autoload.js", "/static/js/bokeh.min.js", "/pages/", "/favicon.ico"):
            status, _, text = asked(address, start + rest)
            assert status == 404, start + rest
            assert token not in text
    assert asked(address, f"/{token}/")[0] == 200


def test_all_that_the_page_needs_is_served_with_it(address):
    path = urlsplit(address).path
    status, headers, page = asked(address, path)
    assert status == 200
    sources = [part.split('"')[0] for part in page.split('src="')[1:]]
    assert sources
    assert all(source.startswith(path) for source in sources)
    assert "cdn.bokeh.org" not in page
    assert asked(address, sources[0])[0] == 200
    for name, value in {
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
    }.items():
        assert headers[name] == value
    policy = headers["Content-Security-Policy"]
    assert "default-src 'self'" in policy
    assert "script-src-attr 'none'" in policy
    assert "http" not in policy


def test_nothing_but_pages_is_served_from_the_folder_of_pages(address):
    path = urlsplit(address).path
    for name in ("../../../../etc/passwd", "..%2f..%2f..%2fetc%2fpasswd", "/etc/passwd", "none.html", ""):
        status, _, text = asked(address, f"{path}pages/{name}")
        assert status in (403, 404)
        assert "root:" not in text


def upgrade(address: str, session: str, origin: str | None) -> int:
    """The status of an answer to a page that wants to talk."""
    found = urlsplit(address)
    headers = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec_WebSocket_Protocol": f"bokeh, {session}",
        "Origin": origin or f"http://{found.netloc}",
    }
    return asked(address, f"{found.path}ws", **headers)[0]


def test_a_session_that_is_none_leaves_the_server_as_it_was(address):
    """What goes wrong in it is printed, with the path less the secret: see the fixture."""
    upgrade(address, "e30", None)
    assert asked(address, urlsplit(address).path)[0] == 200


@pytest.mark.parametrize(
    ("origin", "status"), [("http://evil.example", 403), ("http://127.0.0.1:1", 403), ("null", 403), (None, 101)]
)
def test_a_page_from_elsewhere_cannot_talk_to_it(address, origin, status):
    session = re.search('"token":"([^"]+)"', asked(address, urlsplit(address).path)[2])[1]
    assert upgrade(address, session, origin) == status


def test_it_is_there_for_this_computer_alone(address):
    port = urlsplit(address).port
    for other in {"127.0.0.2", *_own_addresses()}:
        with socket.socket() as tried:
            tried.settimeout(5)
            assert tried.connect_ex((other, port)) != 0, other


def _own_addresses() -> list[str]:
    try:
        found = socket.gethostbyname_ex(socket.gethostname())[2]
    except OSError:
        return []
    return [one for one in found if one != "127.0.0.1"]


# -------------------------------------------------------------------------------------------------------- the command


def test_a_port_that_is_taken_is_one_line(run, tmp_path, address):
    port = urlsplit(address).port
    code, out, err = run("studio", tmp_path, "--port", port)
    assert (code, out, err) == (2, "", f"inphase: --port: {port} is taken; 0 takes one that is free\n")


def test_mistakes_are_one_line(run, tmp_path, monkeypatch):
    for arguments, line in [
        ([tmp_path / "none"], "no such folder"),
        ([tmp_path, "--port", 99999], "--port: expected 0 to 65535, got 99999"),
    ]:
        code, out, err = run("studio", *arguments)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert line in err
    monkeypatch.setitem(sys.modules, "bokeh", None)
    code, out, err = run("studio", tmp_path)
    assert (code, out, err) == (2, "", "inphase: the studio needs bokeh: pip install 'inphase[studio]'\n")


def test_the_studio_is_not_loaded_by_the_others():
    code = "import sys, inphase.cli.studio, inphase.cli.fit; print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"bokeh", "tornado", "inphase.studio.server"} & set(result.stdout.split())


def test_commands_end_with_the_studio(tmp_path):
    write(tmp_path, episodes=1)
    with studio(tmp_path) as address:
        page = urlsplit(address).path
        assert asked(address, page)[0] == 200  # a page, and with it a look at the recordings
        while not running_in(tmp_path):
            time.sleep(0.01)
        asked(address, page)  # another, whose look is only being started when the studio is told to end
    assert running_in(tmp_path) == []


def running_in(folder: Path) -> list[str]:
    """The processes that were started in this folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if os.readlink(process / "cwd") == str(folder):
                found.append(process.name)
        except OSError:
            continue
    return found
