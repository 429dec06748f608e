"""Large deformation: implicit, quasi-static load steps in which points cross cells by themselves, and their gradient.

See `mpmtop.large_deformation.model` for what is solved.
"""
