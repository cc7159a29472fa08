"""``tympan materials``: the library of films and of electric strengths."""

from __future__ import annotations

import argparse

from tympan.options import JSON, command, print_json


@command("materials", JSON)
def run(options: argparse.Namespace) -> None:
    """List the material library with sources."""
    from dataclasses import asdict

    from tympan.fem.film.breakdown import STRENGTH_LIBRARY
    from tympan.fem.film.library import MATERIALS

    if options.json:
        print_json({name: asdict(entry) | {"law": entry.material.law}
                    for name, entry in MATERIALS.items()})
        return
    for name, entry in MATERIALS.items():
        print(f"{name}\n  {entry.material}\n  source: {entry.source}\n  beware: {entry.caveat}")
        if entry.film_source:
            numbers = {"density": entry.density,
                       "relative permittivity": entry.relative_permittivity}
            stated = ", ".join(f"{key} {value:g}" for key, value in numbers.items()
                               if value is not None)
            print(f"  film: {stated} (kg/m³); {entry.film_source}")
    print("\nelectric strengths, for membrane.breakdown")
    for name, strength in STRENGTH_LIBRARY.items():
        print(f"{name}\n  {strength.strength}\n  source: {strength.source}\n"
              f"  beware: {strength.caveat}")
