"""``material fit`` of a dataset: films fitted to runs made by the axisymmetric equations."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.oracles.readings import runs_in_time
from tests.oracles.readings.round_actuators import Hidden
from tests.oracles.readings.runs_in_time import Run
from tests.support.checks.json_schema import faults
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.geometry.errors import InputError
from tympan.reports.schema import json_records
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.film_fit import FilmFit, fit_film
from tympan.studies.files import from_json

RUN = Run(shapes=("middle",), masses=(2e-2,), voltage=5e3, length=60.0, rate=40.0, noise=3e-6)
TWO = Hidden(branch=100e3, time=20.0, others=((100e3, 0.5),))


def test_law_permittivity_and_both_branches_are_within_their_limits(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the specimen that is stored has them."""
    data, folder = runs_in_time.write(tmp_path / "data", TWO, RUN, 1), tmp_path / "fit"
    assert main(["material", "fit", str(data), "-o", str(folder), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    (record,) = [record for record in json_records() if record.name == "film_fit"]
    assert list(faults(printed, record.schema)) == []
    assert printed == json.loads((folder / "film_fit.json").read_text(encoding="utf-8"))
    found = from_json(FilmFit, printed)
    assert found.stiffness_factor.low < TWO.stiffness < found.stiffness_factor.high
    assert found.permittivity_factor.low < TWO.permittivity < found.permittivity_factor.high
    truth = [*TWO.others, (TWO.branch, TWO.time)]
    for branch, (modulus, time) in zip(found.branches, truth, strict=True):
        assert branch.modulus_Pa.low < modulus < branch.modulus_Pa.high
        assert branch.time_s.low < time < branch.time_s.high
    assert found.p_value > 0.01
    assert not any("branch" in words for words in found.not_told)
    film = load_specimen(folder / "middle.toml").membrane
    fitted = sorted(film.branches, key=lambda branch: branch.time)
    assert [branch.modulus for branch in fitted] == pytest.approx(
        [branch.modulus_Pa.value for branch in found.branches])
    assert film.material.mu == pytest.approx(20e3 * found.stiffness_factor.value)


def test_what_a_run_does_not_tell_is_said(tmp_path: Path) -> None:
    """One branch makes no second one, none makes none, and what is asked for is refused."""
    one = read_dataset(runs_in_time.write(tmp_path / "one", Hidden(branch=100e3), RUN, 1))
    (branch,) = fit_film(one).branches
    assert branch.time_s.low < 5.0 < branch.time_s.high
    none = read_dataset(runs_in_time.write(tmp_path / "none", Hidden(), RUN, 1))
    found = fit_film(none)
    assert found.branches == ()
    assert any(words.startswith("no branch shows") for words in found.not_told)
    with pytest.raises(InputError, match="from 0 to 2"):
        fit_film(one, branches=3)


@pytest.mark.parametrize(("more", "words"), [
    (["--law", "gent"], "--law"), (["other"], "one folder"), ([], "no transient.csv")])
def test_what_is_no_such_dataset_is_refused(tmp_path: Path, more: list[str], words: str,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    data = runs_in_time.write(tmp_path / "data", Hidden(), Run(
        shapes=("middle",), masses=(2e-2,), length=1.0), 1)
    (data / "transient.csv").unlink()
    assert main(["material", "fit", str(data), *more]) == 2
    assert words in capsys.readouterr().err
