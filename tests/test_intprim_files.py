"""Files of the old library: model files (.bip), from which no code may run, and analysis files (XML); pictures."""

from __future__ import annotations

import base64
import os
import pickle
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.preprocessing import MinMaxScaler

import intprim
from inphase import DataError, ModelFileError, OptionError, Status
from inphase.io import read_analysis, read_bip
from intprim.util import StatCollector, visualization

# Written by Python 2.7.18 with its highest protocol: weights (3, 4), two scaling groups, a MinMaxScaler for each.
WRITTEN_BY_PYTHON_2 = base64.b64decode(
    "gAJ9cQAoVQdzY2FsZXJzcQFdcQIoY3NrbGVhcm4ucHJlcHJvY2Vzc2luZy5kYXRhCk1pbk1heFNjYWxlcgpxAymBcQR9cQUoVQlkYXRhX21pbl"
    "9xBmNudW1weS5jb3JlLm11bHRpYXJyYXkKX3JlY29uc3RydWN0CnEHY251bXB5Cm5kYXJyYXkKcQhLAIVxCVUBYnEKh3ELUnEMKEsBSwGFcQ1j"
    "bnVtcHkKZHR5cGUKcQ5VAmY4cQ9LAEsBh3EQUnERKEsDVQE8cRJOTk5K/////0r/////SwB0cRNiiVUIAAAAAAAAAMBxFHRxFWJVDWZlYXR1cm"
    "VfcmFuZ2VxFksASwGGcRdVC2RhdGFfcmFuZ2VfcRhoB2gIaAloCodxGVJxGihLAUsBhXEbaA5oD0sASwGHcRxScR1oE2KJVQgAAAAAAAAgQHEe"
    "dHEfYlUGc2NhbGVfcSBoB2gIaAloCodxIVJxIihLAUsBhXEjaA5oD0sASwGHcSRScSVoE2KJVQgAAAAAAADAP3EmdHEnYlUJZGF0YV9tYXhfcS"
    "hoB2gIaAloCodxKVJxKihLAUsBhXEraA5oD0sASwGHcSxScS1oE2KJVQgAAAAAAAAYQHEudHEvYlUPbl9zYW1wbGVzX3NlZW5fcTBLyFUEbWlu"
    "X3ExaAdoCGgJaAqHcTJScTMoSwFLAYVxNGgOaA9LAEsBh3E1UnE2aBNiiVUIAAAAAAAA0D9xN3RxOGJVEF9za2xlYXJuX3ZlcnNpb25xOVUGMC"
    "4yMC40cTpVBGNvcHlxO4h1YmgDKYFxPH1xPShoBmgHaAhoCWgKh3E+UnE/KEsBaA1oDmgPSwBLAYdxQFJxQWgTYolVCAAAAAAAAOA/cUJ0cUNi"
    "aBZoF2gYaAdoCGgJaAqHcURScUUoSwFoG2gOaA9LAEsBh3FGUnFHaBNiiVUIAAAAAAAA4D9xSHRxSWJoIGgHaAhoCWgKh3FKUnFLKEsBaCNoDm"
    "gPSwBLAYdxTFJxTWgTYolVCAAAAAAAAABAcU50cU9iaChoB2gIaAloCodxUFJxUShLAWgraA5oD0sASwGHcVJScVNoE2KJVQgAAAAAAADwP3FU"
    "dHFVYmgwS8hoMWgHaAhoCWgKh3FWUnFXKEsBaDRoDmgPSwBLAYdxWFJxWWgTYolVCAAAAAAAAPC/cVp0cVtiaDloOmg7iHViZVUNYmFzaXNfd2"
    "VpZ2h0c3FcaAdoCGgJaAqHcV1ScV4oSwFLA0sEhnFfaA5oD0sASwGHcWBScWFoE2KJVWAAAAAAAADwvwAAAAAAAOi/AAAAAAAA4L8AAAAAAADQ"
    "vwAAAAAAAAAAAAAAAAAA0D8AAAAAAADgPwAAAAAAAOg/AAAAAAAA8D8AAAAAAAD0PwAAAAAAAPg/AAAAAAAA/D9xYnRxY2JVDnNjYWxpbmdfZ3"
    "JvdXBzcWRdcWUoXXFmKEsASwFlXXFnSwJhZXUu"
)


# -------------------------------------------------------------------------------------------------------- model files


@pytest.fixture
def bip(tmp_path):
    """Write bytes, or a value as a pickle, into a .bip file."""

    def write(content, protocol=2):
        path = tmp_path / "model.bip"
        path.write_bytes(content if isinstance(content, bytes) else pickle.dumps(content, protocol))
        return path

    return write


def scaler(low, high, top=1.0):
    """As the old library fitted them."""
    return MinMaxScaler(feature_range=(0, top)).partial_fit(np.array([[low], [high]]))


def test_a_file_that_python_2_wrote_is_read_without_scikit_learn(bip, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    model = read_bip(bip(WRITTEN_BY_PYTHON_2))
    np.testing.assert_array_equal(model.basis_weights, np.arange(12.0).reshape(3, 4) / 4 - 1)
    assert model.scaling_groups == ((0, 1), (2,))
    np.testing.assert_allclose([model.low, model.high], [[-2.0, 0.5], [6.0, 1.0]], atol=1e-12)


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
@pytest.mark.parametrize(
    "change", [np.copy, np.asfortranarray, lambda w: w[:, ::2], np.float32, lambda w: w.astype(">f8"), lambda w: w[0]]
)
def test_arrays_of_every_protocol_and_order_are_read(bip, protocol, change):
    weights = change(np.random.default_rng(3).normal(size=(5, 6)))
    model = read_bip(bip({"basis_weights": weights, "scaling_groups": None, "scalers": []}, protocol))
    np.testing.assert_array_equal(model.basis_weights, np.atleast_2d(weights))
    assert model.scaling_groups is None


def test_a_file_without_scalers_is_read(bip):
    assert read_bip(bip({"basis_weights": np.eye(2)})).scaling_groups is None


@pytest.mark.parametrize("protocol", [2, 4, 5])
def test_low_and_high_are_what_the_scalers_bring_to_0_and_1(bip, protocol):
    scalers = [scaler(-2.0, 6.0), scaler(10.0, 11.0, top=4.0)]
    groups = [[0, np.int64(2)], np.array([1])]
    model = read_bip(bip({"basis_weights": np.eye(6), "scaling_groups": groups, "scalers": scalers}, protocol))
    assert model.scaling_groups == ((0, 2), (1,))
    for fitted, low, high in zip(scalers, model.low, model.high, strict=True):
        np.testing.assert_allclose([low, high] * fitted.scale_ + fitted.min_, [0, 1], atol=1e-12)


class Attack:
    """What calls a function as soon as an ordinary unpickler meets it."""

    def __init__(self, *call):
        self.call = call

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize("place", ["file", "weights", "scaler", "group"])
def test_no_code_of_a_file_is_run(bip, tmp_path, protocol, place):
    for i, (function, *arguments) in enumerate(
        [
            (os.system, f"touch {tmp_path}/ran0"),
            (eval, f"__import__('pathlib').Path({str(tmp_path / 'ran1')!r}).touch()"),
            (os.mkdir, f"{tmp_path}/ran2"),
        ]
    ):
        attack = Attack(function, tuple(arguments))
        content = {"basis_weights": np.eye(2), "scaling_groups": [[0]], "scalers": []}
        content |= {"weights": {"basis_weights": attack}, "scaler": {"scalers": [attack]}}.get(place, {})
        content |= {"scaling_groups": [attack]} if place == "group" else {}
        path = bip(attack if place == "file" else content, protocol)
        with pytest.raises(ModelFileError, match=r"model\.bip: refused"):
            read_bip(path)
        assert not (tmp_path / f"ran{i}").exists()
        # The attack is a real one: an ordinary unpickler falls for it.
        pickle.loads(path.read_bytes())
        assert (tmp_path / f"ran{i}").exists()
        (tmp_path / f"ran{i}").rmdir() if function is os.mkdir else (tmp_path / f"ran{i}").unlink()


def test_no_module_that_a_file_names_is_imported(bip, tmp_path, monkeypatch):
    (tmp_path / "trap.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(str(tmp_path))
    for data in (b"\x80\x02ctrap\nspring\n.", b"\x80\x04\x8c\x04trap\x8c\x06spring\x93."):
        with pytest.raises(ModelFileError, match=r"refused: it names 'trap\.spring'"):
            read_bip(bip(data))
    assert "trap" not in sys.modules


@pytest.mark.parametrize(
    "data",
    [
        b"\x80\x02cnumpy\nload\n.",
        b"\x80\x02cnumpy.core.multiarray\n_reconstruct.__globals__\n.",
        b"\x80\x04\x8c\x05numpy\x8c\x12ndarray.__reduce__\x93.",
        b"\x80\x02\x82\x01.",  # an extension that a registry knows
        b"\x80\x02Pan id\n.",  # a persistent id
        b"(ios\nsystem\n.",
        b"\x80\x05\x97.",  # a buffer from outside
    ],
)
def test_names_and_instructions_that_no_model_needs_are_refused(bip, data):
    with pytest.raises(ModelFileError, match=r"refused: it (names|holds)"):
        read_bip(bip(data))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a .bip file"),
        (b"PK\x03\x04 not a pickle", "expected a .bip file"),
        ([1, 2], "'basis_weights'"),
        (pickle.dumps({"basis_weights": np.array([])}, 4), r"\(N, B\), got shape \(1, 0\)"),
        ({"basis_weights": np.array([[np.nan]])}, "finite basis weights"),
        ({"basis_weights": np.array([None])}, "elements of kind 'O8'"),
        ({"basis_weights": "many"}, "expected an array of numbers, got str"),
        ({"basis_weights": np.eye(2), "scaling_groups": [[0], [1]], "scalers": []}, "a scaler for each of 2 groups"),
        ({"basis_weights": np.eye(2), "scaling_groups": [[0]], "scalers": [3]}, "MinMaxScalers"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_in_one_line(bip, content, message):
    with pytest.raises(ModelFileError, match=message) as caught:
        read_bip(bip(content))
    assert str(caught.value).count("\n") == 0


def test_a_scaler_that_was_never_fitted_is_told(bip):
    scaler = MinMaxScaler()
    scaler.feature_range = (0, 1)
    with pytest.raises(ModelFileError, match="compute_standardization"):
        read_bip(bip({"basis_weights": np.eye(2), "scaling_groups": [[0]], "scalers": [scaler]}))


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(ModelFileError, match="No such file"):
        read_bip(tmp_path / "none.bip")


def test_a_short_file_cannot_unfold_to_a_huge_one(bip):
    group = [0] * 2000
    with pytest.raises(ModelFileError, match="no more DoFs than weights"):
        read_bip(bip({"basis_weights": np.eye(4), "scaling_groups": [group] * 100_000, "scalers": []}))
    nested = [0]
    for _ in range(60):
        nested = [nested, nested]
    with pytest.raises(ModelFileError, match="expected an array of numbers, got list"):
        read_bip(bip({"basis_weights": nested}))


@settings(max_examples=150)
@given(data=st.data())
def test_a_damaged_file_gives_a_model_file_error_only(tmp_path_factory, data):
    good = WRITTEN_BY_PYTHON_2
    bad = bytearray(good[: data.draw(st.integers(0, len(good)))])
    for _ in range(data.draw(st.integers(0, 3))):
        if bad:
            bad[data.draw(st.integers(0, len(bad) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.bip"
    path.write_bytes(bytes(bad))
    try:
        read_bip(path)
    except ModelFileError as error:
        assert "damaged.bip" in str(error)  # noqa: PT017


# ----------------------------------------------------------------------------------------------------- analysis files


def primitive_and_truth(kind):
    """A primitive of a point that moves in two DoFs of other scale, with a filter, and a movement to follow."""
    names, rng = ["X", "Y"], np.random.default_rng(5)
    basis = intprim.basis.MixtureModel(
        [intprim.basis.GaussianModel(5, 0.1, names[:1]), intprim.basis.PolynomialModel(3, names[1:])]
    )
    moves = [
        np.stack([rng.normal(30, 4) * np.sin(3 * (p := np.linspace(0, 1, 30))), rng.normal(0.2, 0.05) + p**2])
        for _ in range(12)
    ]
    primitive = intprim.BayesianInteractionPrimitive(basis, scaling_groups=[[0], [1]])
    intprim.examples.train_model(primitive, moves)
    of = intprim.filter.spatiotemporal
    np.random.seed(4)  # noqa: NPY002 - as scripts do
    phase = {"initial_phase_mean": [0.0, 1 / 30], "initial_phase_var": [1e-4, 1e-5], "proc_var": 1e-8}
    mean, cov = primitive.get_basis_weight_parameters()
    if kind == "ekf":
        used = of.ExtendedKalmanFilter(basis, **phase, mean_basis_weights=mean, cov_basis_weights=cov)
    else:
        used = (of.EnsembleKalmanFilter if kind == "enkf" else of.ParticleFilter)(
            basis, **phase, initial_ensemble=primitive.basis_weights
        )
    primitive.set_filter(used)
    return primitive, moves[0]


def collected(kind="enkf", **options):
    """The primitive, what was observed, the filter's state and response at every step, and a collector of them."""
    primitive, truth = primitive_and_truth(kind)
    collector = StatCollector(primitive, np.array([0]), np.array([1]))
    mean = primitive.get_mean_trajectory(num_samples=30)
    collector.collect(primitive, np.array([[[] for _ in range(2)]]), mean.T, timestamp=None)
    states, responses = [(primitive.filter.get_mean(), primitive.filter.get_covariance())], [mean]
    for i in range(3, 16, 3):
        response = primitive.generate_probable_trajectory_recursive(
            truth[:, i - 3 : i], np.diag([1e-3, 1e-3]), np.array([1]), num_samples=30 - i
        )[0]
        collector.collect(primitive, truth[:, i - 3 : i].T, response.T, timestamp=i)
        states.append((primitive.filter.get_mean(), primitive.filter.get_covariance()))
        responses.append(response)
    return primitive, truth[:, :15], states, responses, collector


def export(collector, primitive, folder, **options):
    chosen = {"debug_bag_file": "", "response_length": 30, "use_spt": False, "spt_phase": None} | options
    return collector.export(primitive, export_dir_path=folder, **chosen)


def numbers(node):
    return np.array([float(v) for v in node.text.split(",")] if node.text else [])


def test_an_analysis_file_holds_every_element(tmp_path):
    primitive, *_, collector = collected()
    path = export(collector, primitive, tmp_path, debug_bag_file="a<b&c.bag")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.name.startswith("stat_collection_20")
    stats = ElementTree.parse(path).getroot()
    paths = {"/".join(p) for p in walk(stats, ())}
    assert paths == {
        *["stats", "stats/bag_name", "stats/dof", "stats/timesteps", "stats/timesteps/timestep"],
        *[
            f"stats/dof/{name}"
            for name in (
                *["dof_names", "observed_indices", "generated_indices", "ensemble_names", "pdf_names", "pdf_info"],
                *["pdf_info/feature", "response_length", "single_point_trajectory", "latent_state_indices"],
                *["latent_state_indices/feature", "max_oracle_clock", "min_oracle_clock"],
            )
        ],
        *[
            f"stats/timesteps/timestep/{name}"
            for name in (
                *["observed", "observed/feature", "generated", "generated/feature", "oracle"],
                *["ensemble", "ensemble/feature", "pdf", "pdf/feature"],
                *["covariance", "covariance/outer_cov", "covariance/outer_cov/inner_cov"],
            )
        ],
    }
    assert stats.findtext("bag_name") == "a<b&c.bag"
    assert stats.findtext("dof/dof_names") == "X,Y"
    assert stats.findtext("dof/pdf_names") == "Phase,Phase Velocity,X"
    assert [stats.findtext(f"dof/{n}_oracle_clock") for n in ("min", "max")] == ["0.0", "15.0"]
    assert [float(step.get("clock")) for step in stats.iter("timestep")] == [0, 3, 6, 9, 12, 15]
    places = [numbers(node) for node in stats.find("dof/latent_state_indices")]
    assert np.concatenate(places).tolist() == list(range(primitive.basis_weights.shape[1]))


def walk(node, above):
    yield (*above, node.tag)
    for child in node:
        yield from walk(child, (*above, node.tag))


@pytest.mark.parametrize("kind", ["enkf", "ekf", "pf"])
def test_the_covariance_blocks_make_up_the_covariance_of_the_weights(tmp_path, kind):
    primitive, _, states, _, collector = collected(kind)
    root = ElementTree.parse(export(collector, primitive, tmp_path)).getroot()
    split = 5  # weights of X before those of Y
    for (_, cov), step in zip(states, root.iter("timestep"), strict=True):
        blocks = {(o.get("name"), i.get("name")): i for o in step.find("covariance") for i in o}
        assert list(blocks) == [("X", "X"), ("X", "Y"), ("Y", "Y")]
        assert [b.get("same_mode") for b in blocks.values()] == ["True", "False", "True"]
        xx, xy, yy = (numbers(b).reshape(int(b.get("stride")), -1) for b in blocks.values())
        whole = cov[primitive.filter.system_size :, primitive.filter.system_size :]
        for block, truth in ((xx, whole[:split, :split]), (xy, whole[:split, split:]), (yy, whole[split:, split:])):
            np.testing.assert_allclose(block, truth, rtol=1e-8, atol=1e-300)


@pytest.mark.parametrize("kind", ["enkf", "ekf", "pf"])
@pytest.mark.parametrize("fixed", [None, 0.6])
def test_the_densities_are_those_of_the_state_in_units_of_the_dofs(tmp_path, kind, fixed):
    primitive, _, states, _, collector = collected(kind)
    path = export(collector, primitive, tmp_path, use_spt=fixed is not None, spt_phase=fixed)
    for (mean, cov), step in zip(states, ElementTree.parse(path).getroot().iter("timestep"), strict=True):
        pdfs = [(float(f.get("mean")), float(f.get("cov"))) for f in step.find("pdf")]
        now = np.clip(mean[0], 0, 1)
        np.testing.assert_allclose(pdfs[:2], [(now, cov[0, 0]), (mean[1], cov[1, 1])], rtol=1e-12)
        size = primitive.filter.system_size
        at = [now if fixed is None else fixed]
        read = lambda w, at=at: primitive.basis_inverse_transform(np.array(at), w)[0, 0]  # noqa: E731
        slope = np.array([read(one) for one in np.eye(len(mean) - size)]) - read(np.zeros(len(mean) - size))
        assert pdfs[2][0] == pytest.approx(read(mean[size:]), rel=1e-9)
        assert pdfs[2][1] == pytest.approx(slope @ cov[size:, size:] @ slope, rel=1e-8)


def test_the_plane_of_the_ensemble_holds_most_of_its_spread(tmp_path):
    primitive, *_, collector = collected()
    root = ElementTree.parse(export(collector, primitive, tmp_path)).getroot()
    planes = [np.stack([numbers(f) for f in step.find("ensemble")]) for step in root.iter("timestep")]
    shown = np.linalg.eigvalsh(np.cov(np.concatenate(planes, axis=1)))
    everyone = np.concatenate([step.members for step in collector.steps])
    assert planes[0].shape == (2, 12)
    np.testing.assert_allclose(shown, np.linalg.eigvalsh(np.cov(everyone.T))[-2:], rtol=1e-6)


@pytest.mark.parametrize("kind", ["enkf", "ekf"])
def test_what_was_exported_is_read_again(tmp_path, kind):
    primitive, truth, states, responses, collector = collected(kind)
    path = export(collector, primitive, tmp_path, debug_bag_file="run.bag")
    analysis = read_analysis(path)
    dataset, (demonstration,) = analysis.dataset, analysis.dataset
    assert (dataset.observed, dataset.controlled, dataset.provenance["bag"]) == (("Y",), ("X",), "run.bag")
    np.testing.assert_allclose(demonstration.times, np.arange(1, 16), rtol=1e-12)
    np.testing.assert_allclose(demonstration.values, truth[::-1].T, rtol=1e-8)
    assert [e.time for e in analysis.estimates] == [0, 3, 6, 9, 12, 15]
    assert [e.status for e in analysis.estimates] == [Status.NOTHING_SEEN] + 5 * [Status.FOLLOWING]
    for (mean, cov), estimate in zip(states, analysis.estimates, strict=True):
        got = [estimate.phase, estimate.phase_std, estimate.phase_velocity, estimate.phase_velocity_std]
        wanted = [np.clip(mean[0], 0, 1), np.sqrt(cov[0, 0]), mean[1], np.sqrt(cov[1, 1])]
        np.testing.assert_allclose(got, wanted, rtol=1e-9)
    for truth_, estimate, response in zip(responses, analysis.estimates, analysis.responses, strict=True):
        np.testing.assert_allclose(response.mean, truth_[::-1].T, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(response.phases[[0, -1]], [estimate.phase, 1])
        assert response.channels == ("Y", "X")
        assert np.isfinite(response.std).tolist()[0] == [False, True]
        left = (1 - estimate.phase) / estimate.phase_velocity
        np.testing.assert_allclose(response.times[[0, -1]], estimate.time + np.array([0, left]))


# As the library of chapter 4 writes it (its elements, order and formats), with numbers made up for this test.
OLD_STEP = """<timestep clock="{clock}"><observed><feature name="hip">{hip}</feature>
<feature name="arm">{arm}</feature></observed>
<generated><feature name="hip">{resp}</feature><feature name="arm">{resp}</feature></generated><oracle />
<ensemble><feature name="Component 1">0.100,-0.200</feature><feature name="Component 2">0.300,0.400</feature></ensemble>
<pdf><feature cov="0.0004" mean="{phase}" name="Phase" /><feature cov="1e-06" mean="0.5" name="Phase Velocity" />
<feature cov="0.01" mean="0.7" name="arm" /></pdf><covariance><outer_cov name="hip"><inner_cov name="hip"
same_mode="True" stride="1">0.0100</inner_cov></outer_cov></covariance></timestep>"""
OLD_FILE = (
    """<stats><bag_name>walk.bag</bag_name><dof><dof_names>hip,arm</dof_names><observed_indices>0</observed_indices>
<generated_indices>1</generated_indices><ensemble_names>Component 1,Component 2</ensemble_names>
<pdf_names>Phase,Phase Velocity,arm</pdf_names><pdf_info><feature max_range="1.0" min_range="0.0" name="Phase"
num_samples="10" /></pdf_info><response_length>2</response_length>
<single_point_trajectory phase="None">False</single_point_trajectory><latent_state_indices><feature
name="hip">0</feature></latent_state_indices><max_oracle_clock>11.0</max_oracle_clock>
<min_oracle_clock>10.0</min_oracle_clock></dof><timesteps>"""
    + OLD_STEP.format(clock="10.0", hip="", arm="", resp="1.000,2.000", phase="0.0")
    + OLD_STEP.format(clock="10.5", hip="0.100,0.200", arm="1.000,nan", resp="1.500,2.500", phase="0.25")
    + OLD_STEP.format(clock="11.0", hip="0.300", arm="1.250", resp="1.750", phase="0.5")
    + "</timesteps></stats>"
)


def test_a_file_of_the_old_library_is_read(tmp_path):
    path = tmp_path / "stat_collection_2019-05-01_12-00-00.xml"
    path.write_text(OLD_FILE)
    analysis = read_analysis(path)
    (demonstration,) = analysis.dataset
    assert (analysis.dataset.observed, analysis.dataset.controlled) == (("hip",), ("arm",))
    assert analysis.dataset.provenance["bag"] == "walk.bag"
    np.testing.assert_allclose(demonstration.times, [10.25, 10.5, 11.0])
    np.testing.assert_array_equal(demonstration.values, [[0.1, 1], [0.2, np.nan], [0.3, 1.25]])
    assert [(e.time, e.phase, round(e.phase_std, 9)) for e in analysis.estimates] == [
        (10, 0, 0.02),
        (10.5, 0.25, 0.02),
        (11, 0.5, 0.02),
    ]
    second = analysis.responses[1]
    np.testing.assert_allclose(second.phases, [0.25, 1])
    np.testing.assert_allclose(second.times, [10.5, 12])
    np.testing.assert_array_equal(second.mean, [[1.5, 1.5], [2.5, 2.5]])
    assert np.isnan(second.std).all()  # these files tell it in scaled units


def test_a_single_point_is_read_at_its_phase(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(OLD_FILE.replace('phase="None">False', 'phase="0.9">True'))
    assert read_analysis(path).responses[2].phases.tolist() == [0.9]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<stats>", '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><stats>', "refused: it declares"),
        ("<stats>", '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><stats>', "refused: it declares"),
        ("</stats>", "", "expected an analysis file"),
        ("<dof_names>hip,arm</dof_names>", "", "without dof/dof_names in stats"),
        ('name="Phase Velocity"', 'name="Speed"', "Phase Velocity"),
        ("0.100,0.200</feature>", "0.100</feature>", "as many samples of each of hip, arm in observed"),
        ("0.300</feature>", "0.300 m</feature>", "0.300 m"),
        ('clock="10.5"', 'clock="11.5"', "times that increase"),
        ("<generated_indices>1<", "<generated_indices>2<", "expected an analysis file"),
    ],
)
def test_what_is_wrong_with_an_analysis_file_is_told(tmp_path, old, new, message):
    path = tmp_path / "bad.xml"
    assert old in OLD_FILE
    path.write_text(OLD_FILE.replace(old, new, 1) if new or "/" not in old else OLD_FILE.replace(old, new))
    with pytest.raises(DataError, match=message) as caught:
        read_analysis(path)
    assert "bad.xml" in str(caught.value)


@settings(max_examples=100)
@given(data=st.data())
def test_a_damaged_analysis_file_gives_a_data_error_only(tmp_path_factory, data):
    bad = bytearray(OLD_FILE.encode())
    for _ in range(data.draw(st.integers(1, 3))):
        bad[data.draw(st.integers(0, len(bad) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.xml"
    path.write_bytes(bytes(bad))
    try:
        read_analysis(path)
    except DataError as error:
        assert "damaged.xml" in str(error)  # noqa: PT017


def test_mistakes_in_collecting_are_told(tmp_path):
    primitive, *_, collector = collected()
    with pytest.raises(DataError, match=r"timestamp: expected one after 15\.0"):
        collector.collect(primitive, np.zeros((1, 2)), np.zeros((1, 2)), timestamp=15)
    with pytest.raises(DataError, match="timestamp"):
        collector.collect(primitive, np.zeros((1, 2)), np.zeros((1, 2)), timestamp=None)
    with pytest.raises(DataError, match=r"observed_trajectory: expected \(T, D\) with D = 2, got \(2, 5\)"):
        collector.collect(primitive, np.zeros((2, 5)), np.zeros((1, 2)), timestamp=16)
    with pytest.raises(OptionError, match=r"expected the folder .*none to exist"):
        export(collector, primitive, tmp_path / "none")
    with pytest.raises(DataError, match="call collect"):
        export(StatCollector(primitive, [0], [1]), primitive, tmp_path)
    with pytest.raises(OptionError, match="generated_indices"):
        StatCollector(primitive, [2], [1])
    primitive.filter = None
    with pytest.raises(OptionError, match="set_filter"):
        collector.collect(primitive, np.zeros((1, 2)), np.zeros((1, 2)), timestamp=16)
    assert list(tmp_path.iterdir()) == []


# ----------------------------------------------------------------------------------------------------------- pictures


@pytest.fixture
def pyplot():
    from matplotlib import pyplot as plt

    yield plt
    plt.close("all")


def drawn(axes):
    return {line.get_label(): np.array(line.get_xydata()) for line in axes.lines}


def test_a_partial_trajectory_is_drawn_in_the_plane(pyplot):
    inferred, seen, mean = np.random.default_rng(0).normal(size=(3, 2, 7))
    (axes,) = visualization.plot_partial_trajectory(inferred, seen[:, :4], mean).axes
    lines = drawn(axes)
    np.testing.assert_array_equal(lines["Observed"], seen[:, :4].T)
    np.testing.assert_array_equal(lines["Inferred"], inferred.T)
    np.testing.assert_array_equal(lines["Mean"], mean.T)
    assert "4" in axes.get_title()
    with pytest.raises(DataError, match="inferred trajectory: expected at least two DoFs"):
        visualization.plot_partial_trajectory(inferred[:1], seen)


def test_the_other_pictures_show_every_dof_over_the_phase(pyplot):
    first, second, third = np.random.default_rng(0).normal(size=(3, 2, 5))
    phases = np.linspace(0, 1, 5)
    figure = visualization.plot_distribution(["X", "Y"], first, second, third)
    for axes, row in zip(figure.axes, first, strict=True):
        np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.stack([phases, row], axis=1))
    figure = visualization.plot_trajectory(["X", "Y"], first, second)
    assert [sorted(drawn(axes)) for axes in figure.axes] == 2 * [["Inferred", "Observed"]]
    figure = visualization.plot_approximation(["X", "Y"], first, second, third)
    shown = [axes.lines[0].get_ydata() for axes in figure.axes]
    np.testing.assert_array_equal(shown, [first[0], second[0], third[0], first[1], second[1], third[1]])
    figure = visualization.plot_weights(first)
    np.testing.assert_array_equal(figure.axes[0].images[0].get_array(), first)
    with pytest.raises(DataError, match=r"trajectory: expected \(D, T\), got \(2,\)"):
        visualization.plot_weights(first[:, 0])


def test_the_facade_loads_no_library_for_pictures_or_scaling():
    code = "import sys, intprim; print([m for m in ('matplotlib', 'sklearn') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
