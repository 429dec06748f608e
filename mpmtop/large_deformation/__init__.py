"""Large deformation: implicit, quasi-static load steps in which points cross cells by themselves, and their gradient.

    model       discretise(body, h, ppc, shape_function, steps=8, frame, domains, law, alpha) -> Model: what is solved
    law         Hencky, NeoHookean; stress, kirchhoff, von_mises of F
    steps       trajectory(model, moduli): states x, F at every load level; load_steps hands them out one by one
    objectives  EndCompliance, PathCompliance, EndDisplacement, EndStress; one's own: a PathObjective
    problem     LoadStepProblem(model, design, objective, cases), for `mpmtop.optimize`
    at_points   what `mpmtop.plot` and `mpmtop.export` show of a design's evaluation, at full load
    kinematics, background, assembly, step, newton, adjoint        what these are made of

A load acts on the points that start in its region and moves with them; what carries it has to stay solid
(`passive_solid`). Finite elements in large deformation, the reference: `reference_fem.large_deformation` and
`reference_fem.large_design`.
"""
