"""parsolid: solids simulated with particles on many processors."""

import os

__version__ = "0.1.0"

# worth 1.25x on the pair passes; numba reads it once, when it is imported
os.environ.setdefault("NUMBA_SLP_VECTORIZE", "1")
