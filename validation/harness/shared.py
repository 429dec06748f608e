"""Runs that several studies need: made once in a session, by whichever of its processes asks first."""

import os

from joblib import Memory

FOLDER = "MPMTOP_SHARED"
"""Variable that names the session's folder of such runs; without it every call is a run of its own."""

shared = Memory(os.environ.get(FOLDER), verbose=0).cache
"""Decorator of a function of a module whose result follows from its arguments, for this session."""
