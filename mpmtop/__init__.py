"""Topology optimisation with the implicit material point method: a library of small modules, imported one by one."""

__version__ = "0.1.0"
