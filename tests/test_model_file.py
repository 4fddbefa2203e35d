"""Model files: what was saved is what is loaded, bit for bit, and nothing else is ever taken for a model."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interactions import chance_model, dataset, phase_model, shapes_unchecked, taught, waves
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import inphase
from inphase.basis import Gaussian, Layout, Periodic, Polynomial, Sigmoid
from inphase.channels import make_channels
from inphase.preprocess.coordinates import Coordinates
from inphase.tempo import Tempo

RELEASED = Path(__file__).parent / "files"


# ------------------------------------------------------------------------------------------------------------ models


def tiny() -> inphase.Model:
    """Two channels, three demonstrations, every number written here: what files/model_v1.inphase holds."""
    channels = make_channels(["hand_x"], ["grip"], units={"hand_x": "m", "grip": "rad"}, kinds={"grip": "angle"})
    weights = np.outer([1.0, 1.25, 0.5], [0.0, 0.25, 1.0, 0.0, 0.5, 0.75, 1.0]) + 0.125 * np.eye(3, 7)
    return inphase.Model(
        channels=channels,
        coordinates=Coordinates(channels, np.array([0.0, 3.0])),
        scaling=inphase.Scaling(np.array([-1.0, -0.5]), np.array([2.0, 0.5])),
        layout=Layout((Gaussian(4, 0.4), Polynomial(2))),
        prior=inphase.WeightPrior(weights, shrinkage=0.25, trust=0.75, partner=4),
        noise=inphase.Noise(np.array([0.01, 0.02]), np.array([0.1, 0.0])),
        phase=inphase.PhaseModel(np.array([0.0, 0.5]), np.diag([1e-4, 0.01]), 0.01, nominal_velocity=0.5),
        spread=np.array([0.75, 0.25]),
        provenance={"source": "written by hand", "größe": "ü"},
    )


def turning(rng: np.random.Generator) -> inphase.Dataset:
    """An arm that turns past ±π beside a head that nods and shakes."""
    times = np.linspace(0.0, 2.0, 60)
    values = []
    for _ in range(5):
        arm = 3.0 + (0.8 + 0.1 * rng.standard_normal()) * times
        nod, shake = (0.5 + 0.1 * rng.standard_normal(2))[:, None] * [np.sin(times), np.sin(2 * times)]
        head = Rotation.from_euler("yz", np.stack([nod, shake], axis=1)).as_quat()
        values.append(np.column_stack([np.angle(np.exp(1j * arm)), head, np.cos(times), head[:, ::-1]]))
    head = [f"head_q{axis}" for axis in "xyzw"]
    gaze = [f"gaze_q{axis}" for axis in "xyzw"]
    return inphase.Dataset.from_arrays(
        [times] * 5, values, ["arm", *head], ["grip", *gaze], kinds={"arm": "angle"}, units={"arm": "rad", "grip": "m"}
    )


def cycles(rng: np.random.Generator) -> inphase.Dataset:
    times, values = waves(rng, count=4)
    return inphase.Dataset.from_arrays([times] * 4, values, ["a", "b"], ["c", "d"])


def with_order(order: int) -> Callable[[np.random.Generator], inphase.Model]:
    def make(rng: np.random.Generator) -> inphase.Model:
        demos = dataset(rng, count=4)
        return taught(demos, phase=inphase.learn_phase(demos, order=order))

    return make


def periodic(rng: np.random.Generator) -> inphase.Model:
    demos = cycles(rng)
    return taught(demos, basis=Periodic(7, 0.2), phase=inphase.learn_phase(demos, periodic=True))


MODELS: dict[str, Callable[[np.random.Generator], inphase.Model]] = {
    "tiny": lambda rng: tiny(),
    "linear": lambda rng: taught(dataset(rng)),
    "angle and quaternion": lambda rng: taught(turning(rng)),
    "mixed bases": lambda rng: taught(
        dataset(rng), basis={"reach": Sigmoid(8), "lift": Gaussian(9, 0.3), "grip": Polynomial(5)}
    ),
    "periodic": periodic,
    "windows": lambda rng: taught(dataset(rng), active={"reach": (0.1, 0.7), "lift": (0.5, 0.5)}),
    "order 0": with_order(0),
    "order 2": with_order(2),
    "shrinkage": lambda rng: chance_model(rng, phase_model(), shrinkage=0.3, white=False),
}


def assert_same_model(one: inphase.Model, other: inphase.Model) -> None:
    """Every part, bit for bit."""
    for part in ("channels", "layout", "provenance"):
        assert getattr(one, part) == getattr(other, part)
    numbers = {
        "coordinates": ["references"],
        "scaling": ["low", "high"],
        "prior": ["samples", "shrinkage", "trust", "partner", "blocks"],
        "noise": ["var", "correlation_time"],
        "phase": ["mean", "cov", "diffusion", "nominal_velocity", "periodic"],
    }
    for part, names in numbers.items():
        for name in names:
            assert_array_equal(getattr(getattr(one, part), name), getattr(getattr(other, part), name), strict=True)
    assert one.coordinates.channels == other.coordinates.channels
    assert_array_equal(one.spread, other.spread, strict=True)
    assert_array_equal(one.active, other.active, strict=True)


@pytest.mark.parametrize("make", MODELS.values(), ids=MODELS)
def test_what_was_saved_is_what_is_loaded(make, rng, tmp_path):
    model = make(rng)
    path = tmp_path / "a.inphase"
    model.save(path)
    loaded = inphase.Model.load(str(path))
    assert_same_model(model, loaded)
    loaded.save(tmp_path / "b.inphase")
    assert (tmp_path / "b.inphase").read_bytes() == path.read_bytes()
    with pytest.raises(ValueError, match="read-only"):
        loaded.prior.samples[0, 0] = 0.0


@pytest.mark.parametrize("name", ["bip", "ebip"])
@pytest.mark.parametrize("make", MODELS.values(), ids=MODELS)
def test_a_loaded_model_responds_with_the_same_bytes(make, name, rng, tmp_path):
    model = make(rng)
    model.save(tmp_path / "a.inphase")
    loaded = inphase.Model.load(tmp_path / "a.inphase")
    seen = model.predict(np.linspace(0.05, 0.4, 6))[:, : len(model.observed)]
    answers = []
    for one in (model, loaded):
        session = one.session(filter=name, seed=3)
        estimates = [session.observe(0.1 * i, row) for i, row in enumerate(seen)]
        response = session.respond(samples=5, channels="*")
        answers.append((repr(estimates), response.mean.tobytes(), response.std.tobytes(), response.channels))
    assert answers[0] == answers[1]


@pytest.mark.parametrize("version", [1, 2, 3])
def test_every_released_format_still_loads(version):
    """files/model_v*.inphase were written once, by `tiny().save`. A file of the past is never written again."""
    model = inphase.Model.load(RELEASED / f"model_v{version}.inphase")
    assert_same_model(model, tiny())
    session = model.session(filter="bip")
    for time, reading in ((0.0, -0.6), (0.25, 0.2), (0.5, np.nan), (0.75, 0.9)):
        estimate = session.observe(time, [reading])
    response = session.respond(samples=3)
    assert_allclose([estimate.phase, estimate.phase_velocity], EXPECTED["estimate"], rtol=1e-6)
    assert_allclose(response.mean[:, 0], EXPECTED["mean"], rtol=1e-6)
    assert_allclose(response.std[:, 0], EXPECTED["std"], rtol=1e-6)


EXPECTED = {
    "estimate": [0.4339478638559014, 0.5852413535526019],
    "mean": [3.182199133344148, 3.3168484767542763, 3.451497820164405],
    "std": [0.24753123899955284, 0.28595930196082187, 0.3513811082441349],
}


# --------------------------------------------------------------------------------------------------- what is no model


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "model.inphase"
    tiny().save(path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file that is written over and over."""
    return tmp_path_factory.mktemp("scratch") / "broken.inphase"


def refused(path: Path, content: bytes | None = None) -> str:
    """The message with which a file is refused, by ModelFileError and nothing else; it is one line with its name."""
    if content is not None:
        path.write_bytes(content)
    with shapes_unchecked(), pytest.raises(inphase.ModelFileError) as caught:
        inphase.Model.load(path)
    message = str(caught.value)
    assert path.name in message
    assert "\n" not in message
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    return message


@given(data=st.data())
@settings(max_examples=300)
def test_any_byte_changed(data, whole, scratch):
    at = data.draw(st.integers(0, len(whole) - 1))
    change = data.draw(st.integers(1, 255))
    refused(scratch, whole[:at] + bytes([whole[at] ^ change]) + whole[at + 1 :])


def test_every_byte_of_the_prefix_changed(whole, scratch):
    for at in range(56):
        for change in (1, 128, 255):
            refused(scratch, whole[:at] + bytes([whole[at] ^ change]) + whole[at + 1 :])


def test_cut_short_anywhere(whole, scratch):
    for length in [*range(60), *range(60, len(whole), 13), len(whole) - 1]:
        refused(scratch, whole[:length])


@given(more=st.binary(min_size=1, max_size=100))
@settings(max_examples=50)
def test_bytes_appended(more, whole, scratch):
    assert "cut short or damaged" in refused(scratch, whole + more)


@given(content=st.binary(max_size=300))
@settings(max_examples=100)
def test_anything_else(content, scratch):
    message = refused(scratch, content)
    assert "not an inphase model" in message or (b"INPHASE\n".startswith(content[:8]) and "cut short" in message)


@given(prefix=st.binary(max_size=48), rest=st.binary(max_size=100))
@settings(max_examples=200)
def test_any_prefix_behind_the_magic(prefix, rest, scratch):
    refused(scratch, b"INPHASE\n" + prefix + rest)


def test_other_files(tmp_path, whole):
    (tmp_path / "recording.csv").write_text("time,x\n0,1\n")
    assert "not an inphase model" in refused(tmp_path / "recording.csv")
    assert "not an inphase model" in refused(tmp_path / "empty.inphase", b"")
    (tmp_path / "folder").mkdir()
    assert "cannot be read: Is a directory" in refused(tmp_path / "folder")
    assert "cannot be read: No such file" in refused(tmp_path / "missing.inphase")
    assert "cannot be read: No such file" in refused(tmp_path / "nowhere" / "missing.inphase")
    assert "cannot be read: Not a directory" in refused(tmp_path / "recording.csv" / "model.inphase")


def test_a_newer_version_says_so(whole, scratch):
    message = refused(scratch, whole[:8] + struct.pack("<I", 5) + whole[12:])
    assert "expected model format 4 or older, got 5: written by a newer inphase" in message


def cheaply_refused(path: Path) -> str:
    """The message with which a file is refused without holding more than a few kilobytes of it."""
    tracemalloc.start()
    try:
        message = refused(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2**18
    return message


@pytest.mark.parametrize(
    ("header", "payload"), [(2**32 - 1, 0), (0, 2**64 - 1), (2**24 + 1, 8), (100, 2**31 + 8), (2**24, 2**31)]
)
def test_absurd_sizes_are_refused_before_anything_is_read(header, payload, whole, scratch):
    content = whole[:12] + struct.pack("<IQ", header, payload) + whole[24:]
    scratch.write_bytes(content)
    message = cheaply_refused(scratch)
    assert str(max(header, payload)) in message or str(56 + header + payload) in message


@pytest.mark.parametrize(("header", "payload", "what"), [(2**24 + 1, 8, "header"), (100, 2**31 + 8, "payload")])
def test_a_file_that_is_really_as_large_is_refused_too(header, payload, what, whole, tmp_path):
    path = tmp_path / "huge.inphase"
    with path.open("wb") as file:
        file.write(whole[:12] + struct.pack("<IQ", header, payload) + whole[24:56])
        file.truncate(56 + header + payload)  # a hole: it takes no room on the disk
    assert f"expected a {what} of at most" in cheaply_refused(path)


# ------------------------------------------------------------------------------------- a good checksum over bad content


def parts(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and payload of a model file, by the layout that the format promises."""
    size = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[56 : 56 + size]), content[56 + size :]


def sealed(header: Any, payload: bytes, version: int = 4) -> bytes:
    """A file with a good checksum over whatever it holds."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    digest = hashlib.sha256(text + payload).digest()
    return b"INPHASE\n" + struct.pack("<IIQ", version, len(text), len(payload)) + digest + text + payload


def test_the_format_is_what_it_promises_to_be(whole, scratch):
    header, payload = parts(whole)
    scratch.write_bytes(sealed(header, payload))
    assert_same_model(inphase.Model.load(scratch), tiny())


def test_the_first_format_had_no_blocks_and_shrank_to_the_diagonal(whole, scratch):
    header, payload = parts(whole)
    for name in ("tempo", "reflex", "band", "evidence", "active"):
        del header[name]
    del header["prior"]["blocks"]
    scratch.write_bytes(sealed(header, payload, version=1))
    model = inphase.Model.load(scratch)
    assert_same_model(model, tiny())
    weights = model.prior.samples
    expected = np.cov(weights, rowvar=False) * np.where(np.eye(7), 1, 0.75)
    expected[:4, 4:] *= 0.75
    expected[4:, :4] *= 0.75
    assert_allclose(model.prior.cov, expected, atol=1e-12)
    assert "prior" in refused(scratch, sealed({k: v for k, v in header.items() if k != "prior"}, payload, version=1))
    assert "header" in refused(scratch, sealed(header | {"prior": []}, payload, version=1))


def entry(header: Any, path: str) -> tuple[Any, Any]:
    """The container and the key of an entry such as `phase.diffusion` or `channels.0.name`."""
    *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
    for key in way:
        header = header[key]
    return header, last


def paths(value: Any, prefix: str = "") -> list[str]:
    """Every entry of a header, down to the leaves."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else []
    found = []
    for key, inner in items:
        found += [f"{prefix}{key}", *paths(inner, f"{prefix}{key}.")]
    return found


TEMPO = [field.name for field in dataclasses.fields(Tempo)]
HEADER = {  # the shape of the header of `tiny`, for the parameters below
    "channels": [dict.fromkeys(("name", "role", "unit", "kind", "group"), "")] * 2,
    "bases": [{"family": "", "size": 0, "width": 0, "margin": 0}, {"family": "", "degree": 0}],
    "basis_of_feature": [0, 0],
    "prior": {"shrinkage": 0, "trust": 0, "partner": 0, "blocks": []},
    "phase": {"diffusion": 0, "nominal_velocity": 0, "periodic": 0},
    "tempo": dict.fromkeys(TEMPO, 0),
    **dict.fromkeys(("reflex", "band", "evidence", "active"), 0),
    "provenance": {},
    "arrays": {
        name: [0]
        for name in (
            *("references", "low", "high", "weights", "noise_var", "noise_correlation_time"),
            *("phase_mean", "phase_cov", "spread"),
        )
    },
}
LEAVES = paths(HEADER)


def test_the_header_has_the_entries_that_are_broken_below(whole):
    names = paths(parts(whole)[0])
    assert set(LEAVES) <= set(names)
    assert {name.split(".")[0] for name in names} == set(HEADER)


@pytest.mark.parametrize("path", [path for path in LEAVES if not path.split(".")[-1].isdigit()])
def test_a_missing_entry(path, whole, scratch):
    header, payload = parts(whole)
    owner, key = entry(header, path)
    del owner[key]
    if path in ("bases.0.width", "bases.0.margin"):  # those that may be missing: there are usual ones
        assert isinstance(inphase.Model.load(written(scratch, header, payload)).layout.bases[0], Gaussian)
    elif path.startswith("tempo."):
        assert inphase.Model.load(written(scratch, header, payload)).tempo == Tempo()
    else:
        message = refused(scratch, sealed(header, payload))
        assert str(key) in message or (path.startswith("arrays.") and "bytes, got 312" in message)


def written(path: Path, header: Any, payload: bytes) -> Path:
    path.write_bytes(sealed(header, payload))
    return path


WRONG = {
    "null": None,
    "true": True,
    "number": 7,
    "negative": -1,
    "fraction": 0.5,
    "huge": 10**30,
    "text": "seven",
    "empty list": [],
    "list": [1, 2, 3],
    "empty object": {},
    "object": {"a": 1},
    "nan": float("nan"),
    "infinity": float("inf"),
}
RIGHT = {  # what of the above is a value like any other
    ("bases.0.width", "null"),
    ("bases.0.width", "number"),
    ("bases.0.width", "fraction"),
    ("bases.0.margin", "null"),
    ("bases.0.margin", "fraction"),
    *((f"channels.{i}.{key}", "text") for i in (0, 1) for key in ("name", "unit", "group")),
    *(("phase." + key, kind) for key in ("diffusion", "nominal_velocity") for kind in ("number", "fraction", "huge")),
    ("prior.shrinkage", "fraction"),
    ("prior.trust", "fraction"),
    ("prior.partner", "number"),
    ("prior.blocks", "empty list"),
    ("tempo", "empty object"),
    *(("tempo." + name, "fraction") for name in TEMPO),
    *(
        ("tempo." + name, kind)
        for name in TEMPO
        if name not in ("usual", "steady", "leap")
        for kind in ("number", "huge")
    ),
    *(("band", kind) for kind in ("number", "fraction", "huge")),
    ("reflex", "null"),
    ("evidence", "null"),
    ("active", "null"),
    ("provenance", "empty object"),
}


def loads(path: Path, content: bytes) -> bool:
    path.write_bytes(content)
    try:
        with shapes_unchecked():
            inphase.Model.load(path)
    except inphase.ModelFileError:
        return False
    return True


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_value_anywhere(kind, whole, scratch):
    loaded = set()
    for path in LEAVES:
        header, payload = parts(whole)
        owner, key = entry(header, path)
        owner[key] = WRONG[kind]
        if loads(scratch, sealed(header, payload)):
            loaded.add((path, kind))
    assert loaded == {(path, right) for path, right in RIGHT if right == kind}


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"not json",
        b"[1, 2",
        b"\xff\xfe",
        b"null",
        b"[]",
        b"{}",
        b"7",
        b'"text"',
        b"[" * 100_000,
        b"[" * 100_000 + b"]" * 100_000,
        b'{"channels": ' + b'{"a":' * 100_000 + b"1" + b"}" * 100_001,
        b"9" * 10_000,
    ],
    ids=lambda text: f"{text[:12]!r}",
)
def test_a_header_that_is_none(text, whole, scratch):
    assert "header" in refused(scratch, sealed(text, parts(whole)[1]))


def shaped(**shapes: list[Any]) -> Callable[[dict[str, Any]], None]:
    return lambda header: header["arrays"].update(shapes)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (shaped(weights=[-3, -7]), "shapes"),
        (shaped(weights=[3, -7]), "shapes"),
        (shaped(weights=[True, 21]), ""),
        (shaped(weights=[3.0, 7]), "shapes"),
        (shaped(weights=["3", 7]), "shapes"),
        (shaped(weights=[10**30, 7]), "bytes"),
        (shaped(weights=[2**62, 2**62]), "bytes"),
        (shaped(weights=[3, 8]), "bytes"),
        (shaped(weights=[7, 3]), "expected"),
        (shaped(weights=[21]), "weights"),
        (shaped(weights=[3, 1, 7]), "weights"),
        (shaped(weights=[1] * 60 + [21]), "weights"),
        (shaped(weights=[1] * 70 + [21]), ""),
        (shaped(low=[2, 1]), "low"),
        (shaped(references=[1, 2]), "references"),
        (shaped(noise_var=[1, 2]), "var"),
        (shaped(spread=[1, 2]), "spread"),
        (shaped(phase_cov=[4]), "cov"),
        (shaped(phase_mean=[1, 2]), ""),
    ],
)
def test_arrays_of_another_shape(change, expected, whole, scratch):
    header, payload = parts(whole)
    change(header)
    assert expected in refused(scratch, sealed(header, payload))


@pytest.mark.parametrize("shape", [(0, 7), (1, 7), (3, 0), (0, 0), (0, 10**18), (10**18, 0), (0,), (3, 8), (2, 3, 7)])
def test_weights_of_another_shape(shape, whole, scratch):
    header, payload = parts(whole)
    before = 8 * sum(int(np.prod(header["arrays"][name])) for name in ("references", "low", "high"))
    count = int(np.prod(shape, dtype=object))
    header["arrays"]["weights"] = list(shape)
    refused(
        scratch, sealed(header, payload[:before] + np.arange(count).astype("<f8").tobytes() + payload[before + 168 :])
    )


@pytest.mark.parametrize("name", HEADER["arrays"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_arrays_that_are_not_finite(name, value, whole, scratch):
    header, payload = parts(whole)
    at = 0
    for array, shape in header["arrays"].items():
        if array == name:
            break
        at += 8 * int(np.prod(shape))
    assert not loads(scratch, sealed(header, payload[:at] + struct.pack("<d", value) + payload[at + 8 :]))


def changed(**entries: Any) -> Callable[[dict[str, Any]], None]:
    def change(header: dict[str, Any]) -> None:
        for path, value in entries.items():
            owner, key = entry(header, path.replace("__", "."))
            owner[key] = value

    return change


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (changed(bases__0__family="wavelet"), "unknown family of basis functions 'wavelet'; one of gaussian"),
        (changed(bases__0__family="__class__"), "unknown family"),
        (changed(bases__0__size=5), "expected 8, got 7"),
        (changed(bases__0__size=10**9), "whole number"),
        (changed(bases__1__knots=3), "knots"),
        (changed(bases__1={"family": "periodic", "size": 3}), "periodic"),
        (changed(basis_of_feature=[0, 2]), ""),
        (changed(basis_of_feature=[0, -1]), ""),
        (changed(basis_of_feature=[0, True]), ""),
        (changed(basis_of_feature=[0]), "features"),
        (changed(basis_of_feature=[0, 1, 1]), "features"),
        (changed(channels__0__kind="colour"), "colour"),
        (changed(channels__0__role="watched"), "watched"),
        (changed(channels__1__name="hand_x"), "hand_x"),
        (changed(channels__1__kind="linear"), "reference 0"),
        (changed(channels__0__kind="quaternion"), "quaternion"),
        (changed(channels__0__role="controlled", channels__1__role="observed"), "observed"),
        (changed(channels__0__role="controlled"), "observed"),
        (changed(channels__1__role="observed"), "controlled"),
        (changed(prior__shrinkage=1.5), "shrinkage"),
        (changed(prior__trust=1.5), "trust"),
        (changed(prior__blocks=[4, 4]), "blocks of 7 weights together, got 4, 4"),
        (changed(prior__blocks=[7, 0]), "blocks"),
        (changed(prior__blocks=[3.5, 3.5]), "whole number"),
        (changed(prior__blocks=[-1, 8]), "whole number"),
        (changed(prior__partner=8), ""),
        (changed(phase__periodic=True), "periodic"),
        (changed(phase__nominal_velocity=0), "nominal_velocity"),
        (changed(phase__diffusion=-1), "diffusion"),
        (changed(active=[[0, 1]]), "each of 2 features, got (1, 2)"),
        (changed(active=[[0, 1], [0, 1, 1]]), "two phases"),
        (changed(active=[[0, 1], 0.5]), "list"),
        (changed(active=[[0, 1], [0, "1"]]), "number"),
        (changed(active=[[0, 1], [0, 1.5]]), "between 0 and 1"),
        (changed(active=[[0, 1], [0.7, 0.2]]), "from <= until for 'grip'"),
        (changed(active=[[0, 1], [0, float("nan")]]), "between 0 and 1"),
    ],
)
def test_parts_that_make_no_model(change, expected, whole, scratch):
    header, payload = parts(whole)
    change(header)
    assert expected in refused(scratch, sealed(header, payload))


# ------------------------------------------------------------------------------------------------ whole or not at all


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt(), MemoryError()])
def test_nothing_half_written(failure, rng, tmp_path, monkeypatch):
    path = tmp_path / "model.inphase"
    tiny().save(path)
    before = path.read_bytes()

    def half(self: Path, content: bytes) -> int:
        with self.open("wb") as file:
            file.write(content[: len(content) // 2])
        raise failure

    monkeypatch.setattr(Path, "write_bytes", half)
    for target in (path, tmp_path / "new.inphase"):
        with pytest.raises(type(failure)):
            taught(dataset(rng, count=3)).save(target)
    assert [p.name for p in tmp_path.iterdir()] == ["model.inphase"]
    assert path.read_bytes() == before


def test_saving_replaces_the_old_file(rng, tmp_path):
    path = tmp_path / "model.inphase"
    taught(dataset(rng, count=3)).save(path)
    tiny().save(path)
    assert_same_model(inphase.Model.load(path), tiny())
    assert [p.name for p in tmp_path.iterdir()] == ["model.inphase"]


def test_where_a_model_cannot_be_saved(tmp_path):
    with pytest.raises(inphase.OptionError, match=r"nowhere/model\.inphase.*expected the folder .*nowhere to exist"):
        tiny().save(tmp_path / "nowhere" / "model.inphase")
    with pytest.raises(inphase.OptionError, match="expected a file name, got a folder"):
        tiny().save(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_another_file_is_not_written_over(tmp_path):
    recording = tmp_path / "recording.csv"
    recording.write_text("time,x,y\n0,1,2\n")
    model = inphase.Model.load(RELEASED / "model_v1.inphase")
    with pytest.raises(inphase.OptionError, match="expected a model or nothing there"):
        model.save(recording)
    assert recording.read_text().startswith("time")
    model.save(tmp_path / "model.inphase")
    model.save(tmp_path / "model.inphase")
