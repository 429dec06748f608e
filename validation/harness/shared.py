"""Runs that several studies need: made once in a session, by whichever of its processes asks first.

They lie in a folder that the plugin makes anew for every session and names in the environment.
"""

import os
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from joblib import Memory

FOLDER = "MPMTOP_SHARED"
"""Variable that names the session's folder of such runs; without it every call is a run of its own."""

P = ParamSpec("P")
Result = TypeVar("Result")


def shared(function: Callable[P, Result]) -> Callable[P, Result]:
    """Decorator of a function of a module whose result follows from its arguments, for this session.

    A run is known by the function's source and its arguments. The folder is asked for at the call: the plugin imports
    this module before it has made one.
    """

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> Result:
        return Memory(os.environ.get(FOLDER), verbose=0).cache(function)(*args, **kwargs)

    return run
