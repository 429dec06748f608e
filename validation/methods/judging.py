"""The judge judged: what other elements change of its verdicts."""

from mpmtop.criteria import PNormStress
from mpmtop.scene import Scene
from reference_fem.reanalyse import build_judge, judge_stress
from validation.methods.analyser import DensityField

UNCERTAIN = "what verdicts on this page are uncertain by"
"""Why a page reports it."""


def own_error(scene: Scene, design: DensityField, judged: float, split: int = 2) -> float:
    """Relative change of the scene's objective, `judged` by the fine reference, when the reference has `split`
    biquadratic elements along each side of the design's rectangles."""
    judge = build_judge(scene, design.x, design.half_length, split=split)
    judgement = judge(design.rho)
    stress = isinstance(scene.objective, PNormStress)
    value = judge_stress(judge, design.rho, judgement).p_norm if stress else judgement.compliance
    return value / judged - 1
