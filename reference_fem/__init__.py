"""Topology optimisation with finite elements from scikit-fem: the reference the material point method is judged by."""
