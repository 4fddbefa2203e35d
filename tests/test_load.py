"""Recordings on disk: what is read is what was written, and every mistake ends in one line that says where it is."""

from __future__ import annotations

import io
import os
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from inphase import ChannelError, DataError, OptionError, load
from inphase.io import Table, find_episodes, read_episode
from inphase.io import npz as npz_module
from inphase.io.csv import read_csv, write_csv
from inphase.io.npz import read_npz

GOOD = "time,x,y\n0,1,2\n0.1,3,4\n0.2,5,6\n"
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes a file in a folder of its own, which is the current one, so that messages have short paths."""
    monkeypatch.chdir(tmp_path)

    def write(name: str, content: str | bytes = GOOD) -> Path:
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def one_line(error: pytest.ExceptionInfo[BaseException]) -> str:
    message = str(error.value)
    assert "\n" not in message
    return message


def outcome(read: Callable[[Path], Table], path: Path) -> Table | str:
    """The table, or what the DataError says; anything else fails the test."""
    try:
        return read(path)
    except DataError as error:
        return str(error)


# ------------------------------------------------------------------------------------------------------------- CSV

NUMBERS = st.floats(allow_infinity=False) | st.integers(-1000, 1000).map(float) | st.just(np.nan)
TABLES = hnp.arrays(np.float64, st.tuples(st.integers(1, 6), st.integers(2, 5)), elements=NUMBERS)
SPELLINGS = st.sampled_from(["", "nan", "NaN", "NA", "null", " "])


@settings(max_examples=60)
@given(cells=TABLES, data=st.data(), delimiter=st.sampled_from([",", ";", "\t", "|"]))
def test_csv_reads_what_was_written(tmp_path_factory: pytest.TempPathFactory, cells, data, delimiter) -> None:
    cells[:, 0] = np.nan_to_num(cells[:, 0])
    names = ["time", *(f"channel_{i}" for i in range(cells.shape[1] - 1))]
    order = data.draw(st.permutations(range(len(names))))
    ending = data.draw(st.sampled_from(["\n", "\r\n"]))
    lines = [delimiter.join(names[i] for i in order)]
    lines += [
        delimiter.join(data.draw(SPELLINGS) if np.isnan(row[i]) else repr(float(row[i])) for i in order)
        for row in cells
    ]
    path = tmp_path_factory.mktemp("csv") / "episode.csv"
    path.write_bytes((ending.join(lines) + ending).encode())
    table = read_csv(path, delimiter=delimiter)
    assert table.columns == tuple(names[i] for i in order if i)
    np.testing.assert_array_equal(table.times, cells[:, 0])
    np.testing.assert_array_equal(table.pick(names[1:]), cells[:, 1:])


@settings(max_examples=30)
@given(cells=TABLES)
def test_csv_writes_the_very_numbers(tmp_path_factory: pytest.TempPathFactory, cells) -> None:
    path = tmp_path_factory.mktemp("csv") / "episode.csv"
    names = tuple(f'a, "{i}"' for i in range(cells.shape[1] - 1))
    write_csv(path, names, cells[:, 0], cells[:, 1:])
    table = read_csv(path)
    assert table.columns == names
    np.testing.assert_array_equal(table.times, cells[:, 0])
    np.testing.assert_array_equal(table.values, cells[:, 1:])
    np.testing.assert_array_equal(np.signbit(table.values), np.signbit(np.where(np.isnan(cells), np.nan, cells)[:, 1:]))


@pytest.mark.parametrize(
    "text",
    [
        "\ufefftime,x,y\n0,1,2\n0.1,3,4\n0.2,5,6\n",
        " time , x ,y\n 0, 1 ,2\n0.1,3,4\n0.2,5,6",
        '"time","x","y"\n"0","1","2"\n0.1,3,4\n0.2,5,6\n',
        "# time,x,y\n0,1,2\n0.1,3,4\n0.2,5,6\n",
        "time,x,y\n\n0,1,2\n0.1,3,4\n\n0.2,5,6\n\n  \n",
        "time,x,y\r\n0,1,2\r\n0.1,3,4\r\n0.2,5,6\r\n",
        "time,x,y\r0,1,2\r0.1,3,4\r0.2,5,6\r",
    ],
    ids=["byte order mark", "spaces", "quotes", "numpy.savetxt", "blank lines", "CRLF", "CR"],
)
def test_csv_dialects(write: Write, text: str) -> None:
    table = read_csv(write("episode.csv", text))
    assert table.name == "episode.csv"
    assert table.columns == ("x", "y")
    np.testing.assert_array_equal(table.times, [0, 0.1, 0.2])
    np.testing.assert_array_equal(table.values, [[1, 2], [3, 4], [5, 6]])


def test_csv_keeps_what_is_not_its_to_judge(write: Write) -> None:
    table = read_csv(write("episode.csv", "x,clock\ninf,1\n-inf,0.5\n,nan\n"), time="clock")
    np.testing.assert_array_equal(table.times, [1, 0.5, np.nan])
    np.testing.assert_array_equal(table.values, [[np.inf], [-np.inf], [np.nan]])


BAD_CSV = {
    "empty": ("", "expected a header line of names, got an empty file"),
    "blank": ("\n  \n", "expected a header line of names, got an empty file"),
    "header only": ("time,x\n", "expected samples below the header, got none"),
    "no time": ("t,x,y\n0,1,2\n", "no column 'time'; the columns are t, x, y"),
    "semicolon": (
        "time;x;y\n0;1;2\n",
        "expected ',' between columns, found ';': pass delimiter=';' (--delimiter)",
    ),
    "tab": ("time\tx\n0\t1\n", r"expected ',' between columns, found '\t': pass delimiter='\t' (--delimiter)"),
    "space": ("time x y\n0 1 2\n", "expected ',' between columns, found ' ': pass delimiter=' ' (--delimiter)"),
    "pipe": ("time|x\n0|1\n", "expected ',' between columns, found '|': pass delimiter='|' (--delimiter)"),
    "time alone": ("time\n0\n1\n", "expected channels beside 'time', got none"),
    "short row": ("time,x,y\n0,1,2\n0.1,3\n", "line 3: expected 3 cells as in the header, got 2"),
    "long row": ("time,x\n\n0,1\n0.1,3,4\n", "line 4: expected 2 cells as in the header, got 3"),
    "twice": ("time,x,y,x\n0,1,2,3\n", "column names must differ, got twice: x"),
    "time twice": ("time,x,time\n0,1,2\n", "column names must differ, got twice: time"),
    "no name": (",time,x\n0,0,1\n", "expected a name for every column, got none for column 1"),
    "no header": ("0,0.5,1\n0.1,3,4\n", "expected a header line of names, got 0, 0.5, 1"),
    "text": ("time,x,y\n0,1,2\n\n0.1,3,high\n", "line 4, channel 'y': expected a number, got 'high'"),
    "text in time": ("time,x\nnow,1\n", "line 2, channel 'time': expected a number, got 'now'"),
    "text after gap": ("time,x,y\n0,,2\n0.1,3,?\n", "line 3, channel 'y': expected a number, got '?'"),
    "underscore": ("time,x\n0,1_000\n", "line 2, channel 'x': expected a number, got '1_000'"),
    "line break": ('time,"x\ny"\n0,?\n', "line 3, channel 'x y': expected a number, got '?'"),
    "open quote": ('time,x\n0,"1\n', "line 2: expected cells between ','"),
    "not text": (b"time,x\n0,1\n0.1,\xff\n", "line 3: expected text in UTF-8, got the byte 0xff"),
    "null byte": ("time,x\n0,1\0\n", "line 2"),
}


@pytest.mark.parametrize(("content", "expected"), BAD_CSV.values(), ids=BAD_CSV)
def test_bad_csv_says_where(write: Write, content: str | bytes, expected: str) -> None:
    with pytest.raises(DataError) as error:
        read_csv(write("episode.csv", content))
    message = one_line(error)
    assert re.match(r"episode\.csv[:,] ", message)
    assert expected in message


def test_csv_of_another_delimiter(write: Write) -> None:
    path = write("episode.csv", "time;x\n0;1\n0.5;1,5\n")
    with pytest.raises(DataError, match="found ';'"):
        read_csv(path, delimiter="\t")
    with pytest.raises(DataError, match=r"line 3, channel 'x': expected a number, got '1,5' \(a decimal comma\?"):
        read_csv(path, delimiter=";")
    np.testing.assert_array_equal(read_csv(write("b.csv", "time\tx\n0\t1\n"), delimiter=r"\t").values, [[1]])
    np.testing.assert_array_equal(read_csv(write("c.csv", "time   x\n0.25   1\n"), delimiter=" ").values, [[1]])
    for wrong in ("", ";;", '"', "\n"):
        with pytest.raises(OptionError, match="expected a delimiter of one character"):
            read_csv(path, delimiter=wrong)


@settings(max_examples=60)
@given(cut=st.integers(0, len(GOOD)), noise=st.text(',;"\n\r\0 1e-é\ud800', max_size=3))
def test_damaged_csv_is_a_table_or_a_data_error(tmp_path_factory: pytest.TempPathFactory, cut: int, noise: str) -> None:
    path = tmp_path_factory.mktemp("csv") / "episode.csv"
    path.write_bytes((GOOD[:cut] + noise + GOOD[cut:]).encode(errors="surrogatepass"))
    result = outcome(read_csv, path)
    assert isinstance(result, Table) or str(path) in result


# ------------------------------------------------------------------------------------------------------------- npz


def packed(**arrays: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def zipped(**members: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return buffer.getvalue()


def header_claiming(shape: tuple[int, ...], descr: str = "<f8") -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": descr, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


TIMES = np.array([0.0, 0.1, 0.2])
VALUES = np.array([[1.0, np.nan], [3.0, 4.0], [5.0, 6.0]])


@pytest.mark.parametrize(
    "content",
    [
        packed(time=TIMES, x=VALUES[:, 0], y=VALUES[:, 1]),
        packed(time=TIMES, values=VALUES, channels=np.array(["x", "y"])),
        packed(time=TIMES, values=np.asfortranarray(VALUES), channels=["x", "y"]),
        packed(x=VALUES[:, 0].astype(np.int32), y=VALUES[:, 1].astype(np.float32), time=TIMES),
    ],
    ids=["one array a channel", "matrix", "fortran order", "other types"],
)
def test_npz_reads_what_was_written(write: Write, content: bytes) -> None:
    table = read_npz(write("episode.npz", content))
    assert table.columns == ("x", "y")
    np.testing.assert_array_equal(table.times, TIMES)
    np.testing.assert_array_equal(table.values, VALUES)


BAD_NPZ = {
    "not a zip": (b"time,x\n0,1\n", "expected an npz file, got File is not a zip file"),
    "empty file": (b"", "expected an npz file"),
    "truncated": (packed(time=TIMES, x=TIMES)[:-60], "expected an npz file"),
    "no time": (packed(t=TIMES, x=TIMES), "no array 'time'; the arrays are t, x"),
    "time alone": (packed(time=TIMES), "expected arrays of channels beside 'time', got none"),
    "time matrix": (packed(time=VALUES, x=TIMES), "array 'time': expected shape (T,), got (3, 2)"),
    "length": (packed(time=TIMES, x=TIMES[:2]), "array 'x': expected shape (3,) as 'time', got (2,)"),
    "matrix channel": (packed(time=TIMES, hand=VALUES), "array 'hand': expected shape (3,) as 'time', got (3, 2)"),
    "values alone": (packed(time=TIMES, values=VALUES), "array 'values': expected shape (3,) as 'time', got (3, 2)"),
    "objects": (
        packed(time=TIMES, x=np.array([1, None, "a"], dtype=object)),
        "array 'x': expected numbers, got Python",
    ),
    "text": (packed(time=TIMES, x=np.array(["a", "b", "c"])), "array 'x': expected numbers, got <U1"),
    "complex": (packed(time=TIMES, x=TIMES * 1j), "array 'x': expected numbers, got complex128"),
    "channel numbers": (
        packed(time=TIMES, values=VALUES, channels=[1, 2]),
        "array 'channels': expected names (D,), got int64 (2,)",
    ),
    "channel count": (
        packed(time=TIMES, values=VALUES, channels=["x"]),
        "array 'values': expected shape (3, 1) from the times and the channels, got (3, 2)",
    ),
    "channel twice": (
        packed(time=TIMES, values=VALUES, channels=["x", "x"]),
        "array 'channels': names must differ, got twice: x",
    ),
    "no array": (zipped(time=b"0 1 2"), "array 'time' is damaged: "),
    "huge claim": (
        zipped(time=header_claiming((10**12,))),
        "array 'time': 128 bytes cannot hold float64 (1000000000000,)",
    ),
    "endless names": (
        zipped(time=header_claiming((1,)) + bytes(8), channels=header_claiming((10**18,), "<U0")),
        "array 'channels': 128 bytes cannot hold <U0",
    ),
}


@pytest.mark.parametrize(("content", "expected"), BAD_NPZ.values(), ids=BAD_NPZ)
def test_bad_npz_says_which_array(write: Write, content: bytes, expected: str) -> None:
    with pytest.raises(DataError) as error:
        read_npz(write("episode.npz", content))
    message = one_line(error)
    assert message.startswith("episode.npz: ")
    assert expected in message


def test_npz_that_swells_is_not_unpacked(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    content = zipped(time=header_claiming((1000,)) + bytes(8000), x=header_claiming((1000,)) + bytes(8000))
    path = write("episode.npz", content)
    assert len(content) < 1000
    assert len(read_npz(path)) == 1000
    assert npz_module.LARGEST == 2**30
    monkeypatch.setattr(npz_module, "LARGEST", 16_000)
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_: pytest.fail("unpacked"))
    with pytest.raises(DataError, match=r"episode\.npz: expected at most 16000 bytes of arrays, got 16256"):
        read_npz(path)


def test_npz_of_python_2(write: Write) -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3L,), }".ljust(117) + b"\n"
    member = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + TIMES.tobytes()
    np.testing.assert_array_equal(read_npz(write("episode.npz", zipped(time=member, x=member))).times, TIMES)


def test_npz_runs_nothing(write: Write) -> None:
    class Trap:
        def __reduce__(self) -> tuple[Callable[[str], int], tuple[str]]:
            return os.system, ("touch sprung",)

    path = write("episode.npz", packed(time=TIMES, x=np.array([Trap()] * 3, dtype=object)))
    with pytest.raises(DataError):
        read_npz(path)
    assert not Path("sprung").exists()


@settings(max_examples=150)
@given(at=st.integers(0, 1500), byte=st.integers(0, 255), cut=st.booleans())
def test_damaged_npz_is_a_table_or_a_data_error(tmp_path_factory, at: int, byte: int, cut: bool) -> None:
    content = bytearray(packed(time=TIMES, values=VALUES, channels=["x", "y"]))
    at %= len(content)
    if cut:
        del content[at:]
    else:
        content[at] = byte
    path = tmp_path_factory.mktemp("npz") / "episode.npz"
    path.write_bytes(content)
    result = outcome(read_npz, path)
    assert isinstance(result, Table) or str(path) in result


# ----------------------------------------------------------------------------------------------------------- files


def test_folders_are_in_natural_order(write: Write) -> None:
    for number in (10, 9, 1, 2, 100):
        write(f"data/episode_{number}.csv")
    write("data/Episode_3.NPZ")
    write("data/notes.txt")
    write("data/._episode_1.csv")  # what macOS leaves on sticks
    write("data/deeper/episode_4.csv")
    assert [path.stem for path in find_episodes("data")] == [
        "episode_1", "episode_2", "Episode_3", "episode_9", "episode_10", "episode_100",
    ]  # fmt: skip


def test_patterns(write: Write, tmp_path: Path) -> None:
    for name in ("a/2/e.csv", "a/10/e.csv", "a/e.npz", "a/e.txt", "a[1].csv"):
        write(name)
    found = {pattern: [path.as_posix() for path in find_episodes(pattern)] for pattern in ("a/*/e.*", "a/**", "a/?.*")}
    assert found["a/*/e.*"] == ["a/2/e.csv", "a/10/e.csv"]
    assert sorted(found["a/**"]) == ["a/10/e.csv", "a/2/e.csv", "a/e.npz"]
    assert found["a/?.*"] == ["a/e.npz"]
    assert find_episodes("a[1].csv") == [Path("a[1].csv")], "a file is taken literally first"
    assert find_episodes(f"{tmp_path}/a/*.npz") == [tmp_path / "a/e.npz"]
    assert find_episodes(Path("a")) == [Path("a/e.npz")]


def test_sequences_keep_their_order_and_count_a_file_once(write: Write) -> None:
    for name in ("b/1.csv", "b/2.csv", "a/1.csv"):
        write(name)
    assert [p.as_posix() for p in find_episodes(["b/2.csv", Path("b"), "a/*", Path.cwd() / "b/1.csv"])] == [
        "b/2.csv", "b/1.csv", "a/1.csv",
    ]  # fmt: skip


def test_what_gives_no_file_says_so(write: Write) -> None:
    write("handover/episode_001.csv")
    write("handover/notes.txt")
    Path("empty").mkdir()
    write("actions/wave/1.csv")
    write("actions/shake/1.csv")
    write("years/2020/may/1.npz")
    expected = {
        "handovr": "handovr: no such file or folder; near it: handover",
        "handover/episode_01.csv": "handover/episode_01.csv: no such file or folder; near it: episode_001.csv",
        "handover/x": "handover/x: no such file or folder; in handover there is episode_001.csv, notes.txt",
        "nowhere/at/all.csv": "nowhere/at/all.csv: no such file or folder: there is no folder nowhere",
        "empty": "empty: expected .csv or .npz files in the folder, found none",
        "actions": (
            "actions: expected .csv or .npz files in the folder, found them only below it, in shake, wave: "
            "try 'actions/*/*.csv'"
        ),
        "years": (
            "years: expected .csv or .npz files in the folder, found them only below it, in 2020/may: "
            "try 'years/*/*/*.npz'"
        ),
        "handover/*.npz": "handover/*.npz: nothing fits the pattern",
        "handover/*.txt": ("handover/*.txt: expected .csv or .npz files to fit the pattern, got handover/notes.txt"),
        "actions/*": (
            "actions/*: expected .csv or .npz files to fit the pattern, "
            "got folders actions/shake, actions/wave: try 'actions/*/*.csv'"
        ),
        "handover/notes.txt": "handover/notes.txt: expected a file that ends in .csv or .npz, got .txt",
    }
    for source, message in expected.items():
        with pytest.raises(DataError) as error:
            load(source)
        assert one_line(error) == message
    with pytest.raises(DataError, match="expected at least one file, folder or pattern, got none"):
        load([])


def test_suffix_chooses_the_reader(write: Write) -> None:
    assert read_episode(write("a.CSV")).columns == ("x", "y")
    assert read_episode(write("a.npz", packed(time=TIMES, z=TIMES))).columns == ("z",)
    with pytest.raises(DataError, match=r"a\.bag: expected a file that ends in \.csv or \.npz, got \.bag"):
        read_episode(write("a.bag"))


# ------------------------------------------------------------------------------------------------------------ load


def episode(columns: Sequence[str], rows: int = 4, offset: float = 0.0) -> str:
    """Every channel reads its place in the alphabet plus the sample's number, wherever its column stands."""
    lines = [",".join(["time", *columns])]
    lines += [",".join([str(i / 10), *(str(ord(c[-1]) + i + offset) for c in columns)]) for i in range(rows)]
    return "\n".join(lines) + "\n"


def test_roles_come_from_patterns(write: Write) -> None:
    write("data/1.csv", episode(["giver_x", "taker_x", "spare_z", "taker_y"]))
    write("data/2.csv", episode(["taker_y", "extra_q", "taker_x", "giver_x"], rows=7, offset=0.5))
    data = load("data", observed=["taker_?"], controlled="giver_*", units={"*": "m"}, groups={"taker_y": "other"})
    assert data.observed == ("taker_x", "taker_y")
    assert data.controlled == ("giver_x",)
    assert [channel.unit for channel in data.channels] == ["m"] * 3
    assert [channel.group for channel in data.channels] == ["taker", "other", "giver"]
    for demonstration, offset in zip(data, (0.0, 0.5), strict=True):
        expected = np.arange(len(demonstration))[:, None] + [ord("x"), ord("y"), ord("x")] + offset
        np.testing.assert_array_equal(demonstration.values, expected)
        np.testing.assert_allclose(demonstration.times, np.arange(len(demonstration)) / 10)
    assert load("data", observed="taker_x").names == ("taker_x",), "the other role is not loaded"
    assert load("data", controlled="taker_x").controlled == ("taker_x",)
    assert load("data/1.csv").observed == ("giver_x", "taker_x", "spare_z", "taker_y")
    assert load("data", "taker_x", kinds={"taker_x": "angle"}).channels[0].kind.value == "angle"


def test_names_and_provenance(write: Write) -> None:
    for name in ("a/1.csv", "a/2.csv", "b/1.csv", "b/1.npz"):
        write(name, GOOD if name.endswith("csv") else packed(time=TIMES, x=TIMES, y=TIMES))
    assert [d.name for d in load("a")] == ["1", "2"]
    assert [d.name for d in load(["a/1.csv", "a/2.csv", "b/1.csv"])] == ["a/1", "2", "b/1"]
    assert [d.name for d in load("*/*")] == ["a/1", "2", "b/1.csv", "b/1.npz"]
    assert load("a/*.csv").provenance == {"source": "a/*.csv", "episodes": "2"}
    assert load(["a", Path("b/1.csv")]).provenance == {"source": "a, b/1.csv", "episodes": "3"}


BAD_DATA = {
    "missing channel": (
        {"1.csv": GOOD, "2.csv": "time,x,z\n0,1,2\n1,2,3\n2,3,4\n"},
        {},
        DataError("data/2.csv: no channel 'y'; the columns are x, z"),
    ),
    "no fit": (
        {"1.csv": GOOD},
        {"observed": ["hand_?"]},
        ChannelError("data/1.csv: no channel fits 'hand_?'; the channels are x, y"),
    ),
    "both roles": (
        {"1.csv": GOOD},
        {"observed": ["*"], "controlled": ["y"]},
        ChannelError("data/1.csv: expected every channel to be observed or controlled, got as both: y"),
    ),
    "two samples": (
        {"1.csv": GOOD, "2.csv": "time,x,y\n0,1,1\n1,2,1\n"},
        {},
        DataError("data/2.csv: expected at least 3 samples, got 2"),
    ),
    "backwards": (
        {"1.csv": GOOD, "2.csv": "time,x,y\n0,1,1\n1,1,1\n0.5,1,1\n"},
        {},
        DataError("data/2.csv: expected times that increase, got 0.5 s after 1 s at sample 2"),
    ),
    "lost time": (
        {"1.csv": "time,x\n0,1\n,2\n2,3\n"},
        {},
        DataError("data/1.csv: expected finite times, got nan at sample 1"),
    ),
    "infinite": (
        {"1.csv": "time,w,x,y\n0,inf,1,2\n0.5,1,1,-inf\n1,1,1,2\n"},
        {"observed": ["x", "y"]},
        DataError("data/1.csv: expected finite values or NaN, got -inf in channel 'y' at 0.5 s"),
    ),
    "text": (
        {"1.csv": "time,x\n0,one\n"},
        {},
        DataError("data/1.csv, line 2, channel 'x': expected a number, got 'one'"),
    ),
    "unit of nothing": (
        {"1.csv": GOOD},
        {"units": {"hand": "m"}},
        ChannelError("no channel fits 'hand'; the channels are x, y"),
    ),
    "clock": (
        {"1.csv": GOOD},
        {"time": "stamp"},
        DataError("data/1.csv: no column 'stamp'; the columns are time, x, y"),
    ),
}


@pytest.mark.parametrize(("files", "options", "expected"), BAD_DATA.values(), ids=BAD_DATA)
def test_bad_data_is_one_line_that_names_the_file(write: Write, files, options, expected: Exception) -> None:
    for name, content in files.items():
        write(f"data/{name}", content)
    with pytest.raises(type(expected)) as error:
        load("data", **options)
    assert one_line(error) == str(expected)


def test_infinite_values_of_columns_that_are_not_loaded_do_not_matter(write: Write) -> None:
    write("1.csv", "time,w,x\n0,inf,1\n0.5,1,1\n1,1,1\n")
    assert load("1.csv", observed="x").names == ("x",)


def test_trim_cuts_the_idle_ends(write: Write) -> None:
    times = np.arange(400) / 50
    x = np.clip((times - 2) / 3, 0, 1)
    write_csv("1.csv", ("x",), times, x[:, None])
    whole, trimmed = load("1.csv")[0], load("1.csv", trim=True)[0]
    assert (whole.times[0], whole.times[-1]) == (0.0, times[-1])
    assert 1.5 < trimmed.times[0] <= 2.0
    assert 5.0 <= trimmed.times[-1] < 5.5


def test_real_handovers(shared_data: Path) -> None:
    folder = shared_data / "handover"
    data = load(folder, observed="taker_*", controlled="giver_*")
    assert len(data) == len(list(folder.glob("*.csv")))
    assert len(data.observed) == len(data.controlled) == 7
    assert [c.name for c in data.channels if c.kind.value == "quaternion"] == [
        f"{who}_q{axis}" for who in ("taker", "giver") for axis in "xyzw"
    ]
    raw = np.loadtxt(folder / "episode_002.csv", delimiter=",", skiprows=1)  # another reader
    np.testing.assert_array_equal(data[1].times, raw[:, 0])
    np.testing.assert_array_equal(data[1].values, raw[:, 1:])
