"""Arrays as text in a page: quantised where a picture cannot show more, in base64, with a table of what lies where."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

STEPS = 65534  # of the range of what is quantised; one number more means that nothing is there
NOTHING = 65535


class Packing:
    """A buffer that is filled with arrays; `contents` says where each lies, as the page's script expects it."""

    def __init__(self) -> None:
        self.contents: dict[str, dict[str, Any]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, name: str, values: ArrayLike, kind: str = "f4") -> None:
        """Whole numbers and floats as they are: kind is one of u1, i1, u4, f4."""
        self._add(name, np.ascontiguousarray(values, dtype=f"<{kind}"), kind, {})

    def put_quantised(self, name: str, values: Float[np.ndarray, "... C"]) -> None:
        """In 16 bits a number, from the lowest to the highest of each last column; NaN stays; NaN alone is no rows."""
        if not np.isfinite(values).any():
            values = values[:0]  # nothing is known: no rows
        columns = values.reshape(-1, values.shape[-1])
        finite = np.isfinite(columns)
        low = np.where(finite, columns, np.inf).min(0, initial=np.inf)
        high = np.where(finite, columns, -np.inf).max(0, initial=-np.inf)
        known = np.isfinite(low).tolist()
        low, high = (np.where(np.isfinite(edge), edge, 0.0) for edge in (low, high))
        span = np.where(high > low, high - low, 1.0)
        shares = np.where(finite, (columns - low) / span, 0.0)
        codes = np.where(finite, np.round(STEPS * shares), NOTHING).astype("<u2").reshape(values.shape)
        self._add(name, codes, "q2", {"low": low.tolist(), "span": span.tolist(), "known": known})

    def _add(self, name: str, values: np.ndarray, kind: str, more: dict[str, Any]) -> None:
        padding = -self._size % 4  # typed arrays begin at multiples of their size
        self._parts.append(b"\0" * padding + values.tobytes())
        self._size += padding
        self.contents[name] = {"kind": kind, "shape": list(values.shape), "offset": self._size, **more}
        self._size += values.nbytes

    @property
    def text(self) -> str:
        """All of it, in base64."""
        return base64.b64encode(b"".join(self._parts)).decode("ascii")
