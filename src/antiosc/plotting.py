"""Public functions that draw histories, models, maps and fields.

matplotlib is imported when a picture is drawn.

Functions with the argument `ax` draw one chart into matplotlib axes (new axes if `ax` is None) and
return the axes. `plot_history`, `plot_model`, `plot_map` and `plot_deformed` draw a whole picture:
with `path` they write it and return the path, without it they return the figure. `History.plot`,
`AntiOscillators.plot` and `ImpactMap.plot` call them.
"""

from antiosc.fields.pictures import plot_deformed as plot_deformed, plot_map as plot_map
from antiosc.plot.charts import (
    legend_beside as legend_beside,
    panels as panels,
    plot_dynamic_stiffness as plot_dynamic_stiffness,
    plot_force as plot_force,
    plot_history as plot_history,
    plot_masses as plot_masses,
    plot_model as plot_model,
    plot_motion as plot_motion,
    save_figure as save_figure,
)
