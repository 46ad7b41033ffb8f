"""The arrays that the types hold."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32] | NDArray[np.float64]
