"""Slow and right: references that share no equation with the solvers; tests may import them."""
