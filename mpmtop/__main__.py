"""`python -m mpmtop`: new, compare, optimize. See `--help`."""

import os
import sys

from mpmtop.comparison.command import main

if __name__ == "__main__":
    # One thread per process, said before NumPy is loaded: a second one gains little at these sizes, and with it the
    # number of processes would decide last bits.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.exit(main())
