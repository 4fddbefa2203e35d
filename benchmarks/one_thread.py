"""Leaves BLAS one thread, if it is imported before numpy: two make short products slower, and unsteady."""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"
