"""Effects of electrodes in segments: leads that are off or exchanged, segments that cover less."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

from tympan.base.errors import InputError
from tympan.geometry.electrode import OFF, Segment
from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import (
    EffectParameter,
    Place,
    Setup,
    effect,
    segments_in,
)


def _switch(meaning: str) -> EffectParameter:
    return EffectParameter(meaning, "", width=1.0, low=0.0, high=1.0, switch=True, reason=(
        "a lead has contact or has none, and ends at one segment: nothing lies between"))


def _with_segments(setup: Setup, which: str, change: Callable[[Specimen, Segment], Segment]
                   ) -> Setup:
    """Change the segments of one specimen that a place names."""
    specimen, names = segments_in(which)

    def changed(there: Specimen) -> Specimen:
        electrode = there.electrode
        return replace(there, electrode=replace(electrode, segments=tuple(
            change(there, segment) if segment.name in names else segment
            for segment in electrode.segments)))

    return setup.with_specimens(changed, specimen)


@effect("The lead of one segment is off: no voltage reaches the segment, whatever the supply is "
        "set to.",
        finding="Segment {which} is not connected: no voltage reaches it",
        check="measure the voltage on segment {which} itself with a high-voltage probe, or its "
              "capacitance at the lead: without contact there is hardly any")
def segment_open(setup: Setup, off: Annotated[float, _switch("1 where the lead is off")],
                 which: Annotated[str, Place.SEGMENT]) -> Setup:
    """Let no voltage reach one segment."""
    if not off:
        return setup
    return _with_segments(setup, which, lambda specimen, segment: replace(segment, lead=OFF))


@effect("The leads of two segments are exchanged: each gets the voltage that was meant for the "
        "other.",
        finding="The leads of segments {which} are exchanged",
        check="drive one of the segments {which} alone at a low voltage, and look with a "
              "high-voltage probe which one has it")
def segments_exchanged(setup: Setup, on: Annotated[float, _switch("1 where they are exchanged")],
                       which: Annotated[str, Place.PAIR]) -> Setup:
    """Exchange the leads of two segments."""
    specimen, (first, second) = segments_in(which)
    if not on:
        return setup
    leads = dict(zip(setup.specimen(specimen).electrode.names,
                     setup.specimen(specimen).electrode.leads, strict=True))
    other = {first: leads[second], second: leads[first]}
    return _with_segments(setup, which, lambda specimen, segment: replace(
        segment, lead=other[segment.name]))


def _missing(edge: str) -> EffectParameter:
    return EffectParameter(
        f"share of the segment's width that is missing at its {edge} edge", "", width=0.1, low=0.0,
        high=0.45, told_in="%", reason=(
            "a mask or brush that leaves 5 mm of a segment 50 mm wide, as a bare band along the "
            "frame; no source"))


@effect("The electrode of one segment does not reach its edges, and covers less of the film.",
        finding="Segment {which} covers less than stated: {a} of its width is missing at its first "
                "edge and {b} at its last one",
        check="look through the film against a light, for film without electrode in segment "
              "{which}; compare the capacitances of the segments")
def segment_covers_less(setup: Setup, a: Annotated[float, _missing("first")],
                        b: Annotated[float, _missing("last")],
                        which: Annotated[str, Place.SEGMENT]) -> Setup:
    """Make one segment narrower: its sector counterclockwise, or its band from the frame."""
    def narrower(specimen: Specimen, segment: Segment) -> Segment:
        if segment.sector is not None:
            start, end = segment.sector
            return replace(segment, sector=(start + a * segment.width, end - b * segment.width))
        if segment.band is None:
            raise InputError("must have a sector or a band to be narrower than stated",
                             key="electrode.segment", given=segment.name)
        near, far = segment.band
        far = min(far, specimen.gap)
        width = far - near
        return replace(segment, band=(near + a * width, far - b * width))

    return _with_segments(setup, which, narrower) if a or b else setup
