"""Amplitude and phase of a film's response against frequency."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.response import ResponseResult

#: Width on the left of an axis for its numbers and words [mm].
_LEFT = 16.0

#: Height of the axis of the amplitude [mm].
_AMPLITUDE = 55.0
#: Height of the axis of the phase [mm].
_PHASE = 30.0


def draw_response(result: ResponseResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-response.png and .svg; return the files, if any."""
    if not result.frequency_Hz:
        return []
    return style.save_figure(folder, f"{result.specimen}-response", lambda: _bode(result))


def _bode(result: ResponseResult) -> Figure:
    figure, [(above, below)] = style.pairs(1, _AMPLITUDE, _PHASE, _LEFT)
    frequency = result.frequency_Hz
    micrometres = [1e9 * amplitude for amplitude in result.amplitude_m_per_V]
    above.loglog(frequency, micrometres, color=style.colour_of(0), linewidth=1.0)
    below.semilogx(frequency, result.phase_deg, color=style.colour_of(0), linewidth=1.0)
    for axes in (above, below):
        axes.set_xlim(frequency[0], frequency[-1])
        if result.natural_Hz is not None:
            axes.axvline(result.natural_Hz, color="#808080", linewidth=0.6)
    title = f"{result.specimen}, {1e3 * result.mass_kg:g} g about {1e-3 * result.voltage_V:g} kV"
    style.describe(above, "", "amplitude (µm/kV)", title)
    style.describe(below, "frequency (Hz)", "phase (°)")
    return figure
