"""Numbers of each segment of an electrode, in results of a state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from tympan.base.fields import Key, Printed
from tympan.base.units import drive_words
from tympan.fem.results.segments import largest_in_segments, segment_capacitances
from tympan.fem.results.solved_states import SolvedStates


@dataclass(frozen=True, kw_only=True)
class SegmentState:
    """One segment of an electrode in a state of its film."""

    name: Annotated[str, Key("its name")]
    share: Annotated[float, Key("its voltage over that of the film")]
    voltage_V: Annotated[float, Key("voltage across the film in it")]
    capacitance_F: Annotated[float, Key("its charge over its own voltage, with the film as it is")]
    max_field_V_per_m: Annotated[float, Key("largest electric field in it")]
    breakdown_margin: Annotated[float | None, Key(
        "smallest strength over field in it; none without voltage or a strength law")]


#: Field of a result with the segments of the electrode, in the order of the specimen's file. Tables
#: have columns of each, such as ``capacitance_A_F``.
OfSegments = Annotated[tuple[SegmentState, ...], Key(
    "segments of the electrode; empty where it is in one piece, and for a film in closed form"),
    Printed(columns="name")]


def share_words(shares: Mapping[str, float]) -> str:
    """Write the voltages of segments over that of the film, where they differ; else "".

    Examples
    --------
    >>> share_words({"A": 1.0, "B": 0.5}), share_words({"A": 1.0, "B": 1.0})
    ('A 100 %, B 50 %', '')
    """
    if len(set(shares.values())) < 2:
        return ""
    return ", ".join(f"{name} {100 * share:.6g} %" for name, share in shares.items())


@dataclass(frozen=True, kw_only=True)
class Driven:
    """Part of a result at one voltage, with those of the segments.

    Tables have a column of each, such as ``voltage_A_V``.

    Examples
    --------
    >>> Driven(voltage_V=3e3).drive
    '3 kV'
    >>> Driven(voltage_V=3e3, segment_voltages_V={"A": 3e3, "B": 1e3}).drive
    'A 3 kV, B 1 kV'
    """

    voltage_V: Annotated[float, Key("nominal voltage")]
    segment_voltages_V: Annotated[Mapping[str, float], Key(
        "nominal voltages of the segments, by their names; empty for an electrode in one piece"),
        Printed(columns="voltage_V")] = field(default_factory=dict)

    @property
    def drive(self) -> str:
        """Voltage, or those of the segments where they differ."""
        return drive_words(self.segment_voltages_V) or f"{1e-3 * self.voltage_V:.4g} kV"


def segments_of(found: SolvedStates) -> Iterator[tuple[SegmentState, ...]]:
    """Yield the numbers of all segments in each state."""
    model = found.model
    segments = model.specimen.electrode.segments
    if not segments or not model.meshed:
        yield from [()] * len(found.states)
        return
    electrode = model.specimen.electrode
    reaching = electrode.arriving([float(segment.share) for segment in segments])
    capacitances = segment_capacitances(model, found.states).tolist()
    for state, fields, each in zip(found.states, found.at_nodes, capacitances, strict=True):
        voltage = float(np.sqrt(max(state.voltage_squared, 0.0)))
        field, strained = (largest_in_segments(model, values).tolist()
                           for values in (fields.electric_field, fields.breakdown_share))
        yield tuple(SegmentState(
            name=segment.name, share=float(segment.share), voltage_V=reaching[number] * voltage,
            capacitance_F=each[number], max_field_V_per_m=field[number],
            breakdown_margin=found.strength / strained[number] if strained[number] else None)
            for number, segment in enumerate(segments))
