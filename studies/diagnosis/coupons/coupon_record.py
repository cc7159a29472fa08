"""A diagnosis of coupons on disk: what was read and what both models say of it; warm films."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Column, write_sheet
from tympan.studies.data.coupon import MODES
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reduced.coupon_tests import ICE, USUAL_KELVIN, CouponTests

#: The file of readings.
COUPON_FILE = "strips.csv"
#: Its columns: what was judged, and what both models say.
COUPON_COLUMNS: tuple[Column, ...] = (
    Column("line"), Column.labels("specimen"), Column.labels("run", required=False), Column("leg"),
    Column.labels("mode", tuple(MODES)), Column("t", "s", required=False, absent="nan"),
    Column("stretch"), Column("voltage", "kV"), Column("temperature_C"),
    *(Column(name, "kPa", required=False, absent="nan")
      for name in ("read", "sigma", "baseline", "extended")))


def save_coupons(folder: Path, tests: CouponTests, judged: Judgement, chosen: Fit | None) -> None:
    """Write the readings to a folder."""
    table, coupons, row = judged.table, tests.coupons, tests.rows
    names = [specimen.name for specimen in judged.simulation.setup.specimens]
    nominal, best = judged.nominal, chosen or judged.nominal
    write_sheet(folder / COUPON_FILE, COUPON_COLUMNS, {
        "line": table.line, "specimen": [names[number] for number in tests.film[row].tolist()],
        "run": table.run, "leg": table.states.run[table.state], "mode": coupons.mode[row],
        "t": coupons.time[row], "stretch": coupons.stretch[row], "voltage": coupons.volts[row],
        "temperature_C": coupons.degrees[row], "sigma": tests.spread(table.sigma),
        **{name: tests.as_read(values) for name, values in (
            ("read", table.value), ("baseline", nominal.predicted(table)),
            ("extended", best.predicted(table)))}})


def at_temperature(specimen: Specimen, celsius: float) -> Specimen:
    """The specimen as its film is at a temperature [°C], under a name of its own."""
    film = specimen.membrane
    factor = ((celsius + ICE) / USUAL_KELVIN) ** film.temperature_power
    warm = replace(film, material=scaled(film.material, factor), temperature_power=0.0,
                   branches=tuple(replace(branch, modulus=factor * branch.modulus)
                                  for branch in film.branches))
    return replace(specimen, name=f"{specimen.name} at {celsius:.4g} C", membrane=warm)
