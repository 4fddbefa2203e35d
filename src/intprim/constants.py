"""What every array of IntPrim is made of (4.2.1)."""

import numpy as np

DTYPE = np.float64

DEFAULT_NUM_SAMPLES = 100
