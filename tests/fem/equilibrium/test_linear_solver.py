"""Sparse factorisation, elimination order and assembly against dense linear algebra and plain sums.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from scipy.sparse import block_array, bmat, coo_matrix, csc_matrix, eye_array
from scipy.sparse.linalg import splu

from tests.support.models import deformed, model
from tests.support.specimens import circular, skewed
from tympan.fem.linear_solver.direct import (
    Analysis,
    SuperLU,
    SuperLUFactors,
    analyse,
    factorise,
)
from tympan.fem.linear_solver.dissection import elimination_order
from tympan.fem.linear_solver.pardiso import Pardiso
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State

SOLVERS = ("SuperLU", *(["Pardiso"] if find_spec("pypardiso") else []))


@pytest.fixture(scope="module", params=(2, 4))
def film(request: pytest.FixtureRequest) -> Model:
    return model(circular(), symmetry=False, refine=1.6 / request.param, order=request.param)


@pytest.fixture(scope="module")
def tangent(film: Model) -> csc_matrix:
    positions, plate = deformed(film)
    return film.linearised(State(positions, plate, 2500.0**2)).inner


def assert_equals(found: np.ndarray, expected: np.ndarray, rel: float, abs_: float) -> None:
    """As ``pytest.approx``, which takes seconds for a million numbers."""
    assert found.shape == expected.shape
    assert (np.abs(found - expected) <= np.maximum(rel * np.abs(expected), abs_)).all()


def analysis_by(name: str, matrix: csc_matrix, ordered: bool = False) -> Analysis:
    return Pardiso(matrix.indices, matrix.indptr) if name == "Pardiso" else SuperLU(ordered)


def counted(matrix: csc_matrix) -> int:
    return int(np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0))


def shifted(matrix: csc_matrix, quantile: float) -> csc_matrix:
    """Indefinite: that share of the eigenvalues made negative, zero well between two of them."""
    values = np.linalg.eigvalsh(matrix.toarray())
    k = int(quantile * len(values))
    return csc_matrix(matrix - eye_array(len(values)) * (values[k - 1] + values[k]) / 2)


@pytest.mark.parametrize("name", SOLVERS)
def test_solves_one_and_several_right_hand_sides(name: str, film: Model,
                                                 tangent: csc_matrix) -> None:
    factors = factorise(tangent, analysis_by(name, tangent, ordered=True))
    right = np.random.default_rng(0).normal(size=(tangent.shape[0], 3))
    exact = np.linalg.solve(tangent.toarray(), right)
    assert factors.solve(right) == pytest.approx(exact, rel=1e-8, abs=1e-10 * np.abs(exact).max())
    assert factors.solve(right[:, 1]) == pytest.approx(exact[:, 1], rel=1e-8,
                                                       abs=1e-10 * np.abs(exact).max())
    assert factors.solve(right[:, :0]).shape == (tangent.shape[0], 0)


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("quantile", [0.003, 0.5])
def test_counts_negative_eigenvalues(name: str, quantile: float, film: Model,
                                     tangent: csc_matrix) -> None:
    matrix = shifted(tangent, quantile)
    factors = factorise(matrix, analysis_by(name, matrix, ordered=True))
    assert factors.negative == counted(matrix) > 0


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("first", [True, False])
def test_counts_them_where_the_diagonal_is_zero(name: str, first: bool,
                                                tangent: csc_matrix) -> None:
    """A saddle: as many negative eigenvalues as constraints, whose zero pivots come first or last.
    """
    size = tangent.shape[0]
    constraint = coo_matrix((np.full(60, tangent.diagonal().max()),
                             (np.arange(60) * 7 % size, np.arange(60) // 2)),
                            (size, 30))
    zero = coo_matrix((np.zeros(30), (np.arange(30), np.arange(30))), (30, 30))
    blocks = [[zero, constraint.T], [constraint, tangent]] if first else [[tangent, constraint],
                                                                          [constraint.T, zero]]
    matrix = csc_matrix(block_array(blocks, format="csc"))
    for ordered in (True, False):
        factors = factorise(matrix, analysis_by(name, matrix, ordered))
        right = np.ones(size + 30)
        assert matrix @ factors.solve(right) == pytest.approx(right, rel=1e-6)
        assert factors.negative == counted(matrix) == 30


def test_counts_them_where_rows_were_exchanged(tangent: csc_matrix) -> None:
    pair = csc_matrix(np.array([[0.0, 1.0], [1.0, 0.0]]) * tangent.diagonal().max())
    matrix = csc_matrix(bmat([[pair, None], [None, shifted(tangent, 0.1)]]))
    factors = SuperLU(ordered=True).factorise(matrix)
    assert (factors.factors.perm_r != factors.factors.perm_c).any()
    assert factors.negative == counted(matrix)


def test_counts_them_where_pivots_are_tiny(tangent: csc_matrix) -> None:
    """Without pivoting these lose all digits, and with them the signs of what follows."""
    scale = tangent.diagonal().max()
    rng = np.random.default_rng(3)
    coupling = coo_matrix(rng.normal(size=(20, tangent.shape[0])) * scale * 0.1)
    tiny = eye_array(20) * 1e-15 * scale
    matrix = csc_matrix(bmat([[tiny, coupling], [coupling.T, shifted(tangent, 0.2)]]))
    factors = SuperLU(ordered=True).factorise(matrix)
    assert factors.negative == counted(matrix)


@pytest.mark.parametrize("name", SOLVERS)
def test_factors_outlive_later_ones_of_the_same_analysis(name: str, tangent: csc_matrix) -> None:
    analysis = analysis_by(name, tangent)
    right = np.ones(tangent.shape[0])
    first = factorise(tangent, analysis)
    before = first.solve(right)
    for factor in (2.0, -3.0, 5.0):
        later = factorise(factor * tangent, analysis)
        assert later.solve(right) == pytest.approx(before / factor, rel=1e-8)
        assert later.negative == (tangent.shape[0] - first.negative if factor < 0
                                  else first.negative)
    assert (first.solve(right) == before).all()


@pytest.mark.parametrize("name", SOLVERS)
def test_a_singular_matrix_is_refused_or_blows_up(name: str) -> None:
    matrix = csc_matrix(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0]]))
    try:
        solution = factorise(matrix, analysis_by(name, matrix)).solve(np.array([1.0, 0.0, 0.0]))
    except RuntimeError:
        return
    assert not np.abs(solution).max() < 1e10


def test_small_systems_are_scipy_s() -> None:
    unit = csc_matrix(eye_array(10))
    assert isinstance(analyse(unit.indices, unit.indptr), SuperLU)


def test_order_is_a_permutation_with_less_fill_than_minimum_degree() -> None:
    film = model(circular(), symmetry=False, refine=3.0, order=2)
    order = elimination_order(film.discretisation.connectivity,
                              film.discretisation.reference[:, :2])
    assert (np.sort(order) == np.arange(len(film.discretisation.reference))).all()
    positions, plate = deformed(film)
    matrix = film.linearised(State(positions, plate)).inner
    ours = SuperLU(ordered=True).factorise(matrix)
    theirs = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                  options={"SymmetricMode": True})
    assert isinstance(ours, SuperLUFactors)
    assert ours.factors.nnz < theirs.nnz


def test_fill_grows_little_faster_than_the_unknowns() -> None:
    """n log n: doubling the elements each way quadruples the unknowns and adds less than another
    half to the fill."""
    fills, sizes = [], []
    for refine in (1.5, 3.0):
        film = model(circular(), symmetry=False, refine=refine, order=2)
        matrix = film.linearised(film.mounted()).inner
        fills.append(SuperLU(ordered=True).factorise(matrix).factors.nnz)
        sizes.append(matrix.shape[0])
    assert fills[1] / fills[0] < 1.5 * sizes[1] / sizes[0]


@pytest.mark.parametrize("symmetry", [True, False])
def test_assembly_is_the_sum_of_the_elements(symmetry: bool) -> None:
    """Also where symmetry leaves only some components of a node free."""
    film = model(circular(), symmetry=symmetry, refine=0.7, order=3)
    local = 3 * film.discretisation.connectivity.shape[1]
    size = len(film.discretisation.connectivity), local, local
    elements = np.random.default_rng(0).normal(size=size)
    elements += elements.transpose(0, 2, 1)
    number = (3 * film.discretisation.connectivity[:, :, None] + np.arange(3)).reshape(-1, local)
    rows, columns = np.repeat(number, local, axis=1).ravel(), np.tile(number, local).ravel()
    whole = coo_matrix((elements.ravel(), (rows, columns)),
                       (film.discretisation.reference.size,) * 2).tocsc()
    node, component = film.discretisation.free
    free = 3 * node + component
    inner = film.discretisation.unknowns.pattern.assemble(elements)
    inner.check_format()
    assert inner.has_sorted_indices
    assert_equals(inner.toarray(), whole[free][:, free].toarray(), rel=1e-13, abs_=1e-13)


def test_temporaries_of_the_tangents_do_not_grow_with_the_mesh(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Any size of chunk gives the same tangents; the largest temporary is the chunk's."""
    film = model(skewed(), order=4)
    positions, _ = deformed(film)
    f = film.discretisation.deformation(positions)
    from tympan.fem.discretisation import assembly
    from tympan.fem.membrane.model import cauchy_green

    density = film.density(2500.0**2)(cauchy_green(f))
    parts = film.discretisation.gradients, f, density.stress, density.tangent, film.volumes
    whole = assembly.element_tangents(*parts)
    monkeypatch.setattr(assembly, "_CHUNK", 1)
    single = assembly.element_tangents(*parts)
    assert_equals(single, whole, rel=1e-12, abs_=1e-13 * np.abs(whole).max())
