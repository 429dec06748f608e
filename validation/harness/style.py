"""The style of every figure of the report."""

from typing import Any

from cycler import cycler

# Okabe and Ito's colours but for yellow, too faint on white; line styles tell them apart where they print grey.
STYLE: dict[str, Any] = {
    "axes.prop_cycle": cycler(
        color=["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000"],
        linestyle=["-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1))],
    ),
    "axes.formatter.use_mathtext": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    # 5 in fill a phone's 390 px with letters of 11 px; wider figures shrink theirs.
    "figure.figsize": (5.0, 3.4),
    "font.size": 11.0,
    "image.cmap": "cividis",
    "legend.frameon": False,
    "legend.fontsize": "small",
    "lines.linewidth": 1.8,
    "savefig.bbox": "tight",  # equal axes leave blank bands
    "savefig.dpi": 200,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # letters as drawn here: no font of the reader's can move or clip them
}
