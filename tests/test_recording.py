"""A recorded run: parts that fit, values that stay."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inphase import ChannelError, DataError, Estimate, Recording, Response, Status
from inphase.channels import make_channels

CHANNELS = make_channels(["hip"], ["arm"])
ESTIMATE = Estimate(0.1, 0.2, 0.1, 1.0, 0.1, -1.0, Status.FOLLOWING)
RESPONSE = Response(np.array([0.1]), np.array([0.2]), np.zeros((1, 1)), np.ones((1, 1)), ("arm",))


def recording(**parts: Any) -> Recording:
    values = np.array([[0.0, 1.0], [0.1, np.nan], [0.2, 3.0]])
    usual = {"times": np.arange(3.0), "values": values, "estimates": (ESTIMATE,), "responses": (RESPONSE,)}
    return Recording(**({"name": "walk", "channels": CHANNELS, "provenance": {"bag": "a.bag"}} | usual | parts))


def test_what_was_seen_is_a_demonstration() -> None:
    made = recording()
    (demonstration,) = made.dataset
    assert (made.dataset.observed, made.dataset.controlled, demonstration.name) == (("hip",), ("arm",), "walk")
    np.testing.assert_array_equal(demonstration.values, made.values)
    assert made.dataset.provenance == {"bag": "a.bag"}


def test_a_run_may_be_as_short_as_nothing_and_unanswered() -> None:
    empty = recording(times=np.empty(0), values=np.empty((0, 2)), estimates=(), responses=())
    assert len(empty.times) == 0
    with pytest.raises(DataError, match="at least 3 samples"):
        _ = empty.dataset
    assert recording(responses=(None,)).responses == (None,)


def test_values_are_read_only_and_its_own() -> None:
    times = np.arange(3.0)
    made = recording(times=times)
    times[0] = -5.0
    assert made.times[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        made.values[0, 0] = 1.0


@pytest.mark.parametrize(
    ("parts", "error", "message"),
    [
        ({"times": np.arange(3.0)[::-1]}, DataError, "walk: expected finite times that increase"),
        ({"times": np.array([0.0, np.nan, 2.0])}, DataError, "finite times"),
        ({"values": np.zeros((3, 1))}, DataError, r"expected values \(T, D\) = \(3, 2\), got \(3, 1\)"),
        ({"responses": ()}, DataError, "a response or None for each of 1 estimates, got 0"),
        ({"channels": CHANNELS[::-1]}, ChannelError, "observed channels before"),
    ],
)
def test_parts_that_do_not_fit_are_refused(parts: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        recording(**parts)
