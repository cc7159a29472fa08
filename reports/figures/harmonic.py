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
#: Styles of deflection and both tilts, which may lie upon each other.
_DASHES = ("-", "-", "--")
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
    if any(micrometres):
        above.loglog(frequency, micrometres, color=style.colour_of(0), linewidth=1.0,
                     label="deflection")
        below.semilogx(frequency, result.phase_deg, color=style.colour_of(0), linewidth=1.0)
    else:  # by symmetry the plate only tilts
        above.set_yticks([])
    tilting = [(axis, getattr(result, f"tilt_{axis}_rad_per_V")) for axis in "xy"]
    tilting = [(axis, slope) for axis, slope in tilting if slope]
    slopes = above.twinx() if tilting else None
    for number, (axis, slope) in enumerate(tilting, start=1):
        assert slopes is not None
        colour, dashes = style.colour_of(number), _DASHES[number]
        slopes.loglog(frequency, [1e6 * each for each in slope], dashes, label=f"tilt {axis}",
                      color=colour, linewidth=1.0)
        below.semilogx(frequency, getattr(result, f"tilt_{axis}_phase_deg"), dashes,
                       color=colour, linewidth=1.0)
    if slopes is not None:
        style.describe(slopes, "", "tilt (mrad/kV)")
        lines = [*above.get_lines(), *slopes.get_lines()]
        above.legend(lines, [str(line.get_label()) for line in lines], loc="lower left")
    for axes in (above, below):
        axes.set_xlim(frequency[0], frequency[-1])
        if result.natural_Hz is not None:
            axes.axvline(result.natural_Hz, color="#808080", linewidth=0.6)
    title = f"{result.specimen}, {1e3 * result.mass_kg:g} g about {1e-3 * result.voltage_V:g} kV"
    style.describe(above, "", "amplitude (µm/kV)", title)
    style.describe(below, "frequency (Hz)", "phase (°)")
    return figure
