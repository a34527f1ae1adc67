"""Figures of the paper, drawn from records.

Every function returns a `DataFigure`: a Matplotlib figure that carries its caption and the data
behind it. `save_figure` writes all of them side by side. Nothing here uses pyplot, so drawing
leaves no global state and needs no display. Colours are from the Okabe-Ito set, which stays
distinguishable under colour blindness; markers or line widths differ as well.
"""

import sys
from typing import Any

from pyfric.figures.fitted import fit_page, tornado
from pyfric.figures.interface import fig3a, fig3b, fig4a, fig4b
from pyfric.figures.lengths import fig2a, fig2b
from pyfric.figures.loading import fig1a, fig1b, figure_caption, slip_segments
from pyfric.figures.phases import phase_map
from pyfric.figures.results import curve_figure, resolution_figure, sweep_figure
from pyfric.figures.sizes import size_figure
from pyfric.figures.sketch import sketch
from pyfric.figures.spacetime import space_time
from pyfric.figures.strip import event_frames, event_movie, event_strip, has_ffmpeg
from pyfric.figures.style import BLACK as BLACK
from pyfric.figures.style import BLUE as BLUE
from pyfric.figures.style import FIGURES, DataFigure, PaperFigure, save_figure
from pyfric.figures.style import GREEN as GREEN
from pyfric.figures.style import GREY as GREY
from pyfric.figures.style import ORANGE as ORANGE
from pyfric.figures.style import PURPLE as PURPLE
from pyfric.figures.style import SKY as SKY
from pyfric.figures.style import VERMILION as VERMILION
from pyfric.figures.style import legend as legend
from pyfric.figures.style import mark as mark
from pyfric.figures.style import panels as panels
from pyfric.figures.view import drawing as drawing
from pyfric.figures.view import record_page
from pyfric.figures.view import template as template
from pyfric.values import no_attribute


def __getattr__(name: str) -> Any:
    """Raise AttributeError for an unknown name, and suggest a known one."""
    raise no_attribute("figures", name, sys.modules[__name__], known=__all__)


__all__ = [
    "FIGURES",
    "DataFigure",
    "PaperFigure",
    "curve_figure",
    "event_frames",
    "event_movie",
    "event_strip",
    "fig1a",
    "fig1b",
    "fig2a",
    "fig2b",
    "fig3a",
    "fig3b",
    "fig4a",
    "fig4b",
    "figure_caption",
    "fit_page",
    "has_ffmpeg",
    "phase_map",
    "record_page",
    "resolution_figure",
    "save_figure",
    "size_figure",
    "sketch",
    "slip_segments",
    "space_time",
    "sweep_figure",
    "tornado",
]
