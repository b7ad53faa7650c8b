"""Charts and pictures of histories, models, maps and fields, for use by name.

matplotlib is imported when one is drawn.

Functions that take `ax` draw one chart into matplotlib axes (new ones where `ax` is None) and
return them. `plot_history`, `plot_model`, `plot_map` and `plot_deformed` draw a whole picture: with
`path` they write it and return the path, without it they return the figure. `History.plot`,
`AntiOscillators.plot` and `ImpactMap.plot` call them.
"""

from antiosc.fields.pictures import plot_deformed, plot_map
from antiosc.plot.charts import (
    legend_beside,
    panels,
    plot_dynamic_stiffness,
    plot_force,
    plot_history,
    plot_masses,
    plot_model,
    plot_motion,
    save_figure,
)

__all__ = [
    "legend_beside",
    "panels",
    "plot_deformed",
    "plot_dynamic_stiffness",
    "plot_force",
    "plot_history",
    "plot_map",
    "plot_masses",
    "plot_model",
    "plot_motion",
    "save_figure",
]
