"""Large deformation: implicit, quasi-static load steps in which points cross cells by themselves, and the exact gradient
through all of them. See `mpmtop.large_deformation.model` for what is solved."""
