"""Nonlinear programs of many like blocks: one block of a kind is differentiated for all of them.

To differentiate a whole program takes longer than to solve it. Here each kind of block, say an
interval or a corner beside a line, is a small function of a few variables. Its derivatives are
mapped over all blocks of the kind, and their entries put where they belong.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray


class Kind(NamedTuple):
    """One block, differentiated: entries of derivatives in the order of their sparsity."""

    price: Any  # function: (variables, given) -> objective
    value: Any  # function: (variables, given) -> rows
    slope: Any  # function: (variables, given) -> entries of the Jacobian
    curve: Any  # function: (variables, given, of objective, of rows) -> entries of the Hessian
    jacobian: tuple[IntArray, IntArray]  # row and variable of each entry
    hessian: tuple[IntArray, IntArray]  # both variables of each entry, of the upper triangle
    size: int  # number of variables
    given: int  # number of parameters
    limits: Array  # (rows, 2)
    is_priced: bool  # whether it adds to the objective


class Blocks(NamedTuple):
    """Blocks of one kind: which variables each has, and what is given to it."""

    kind: Kind
    variables: IntArray  # (size, n) numbers of variables of the program
    given: Array | IntArray  # (given, n) values, or numbers of parameters of the program

    @property
    def rows(self) -> int:
        """Number of rows of all of them."""
        return len(self.kind.limits) * self.number

    @property
    def number(self) -> int:
        """Number of blocks."""
        return int(self.variables.shape[1])


def kind_of(
    casadi: Any,
    variables: Any,
    given: Any,
    *,
    price: Any = 0.0,
    zero: Any = None,
    below: Any = None,
    within: Sequence[tuple[Any, float, float]] = (),
) -> Kind:
    """A kind of block from the symbols of one: its price, and rows.

    Some are zero, some not positive, some `within` a lower and an upper limit.
    """
    zero, below = (casadi.SX(0, 1) if some is None else some for some in (zero, below))
    price, rows = casadi.SX(price), casadi.vertcat(zero, below, *(row for row, *_ in within))
    limits = np.zeros((rows.shape[0], 2))
    limits[zero.shape[0] :, 0] = -np.inf
    limits[rows.shape[0] - len(within) :] = [pair for _, *pair in within] or np.zeros((0, 2))
    of_price, of_rows = casadi.SX.sym("of_price"), casadi.SX.sym("of_rows", rows.shape[0])
    jacobian, weights = casadi.jacobian(rows, variables), (of_price, of_rows)
    lagrangian = of_price * price + casadi.dot(of_rows, rows)
    hessian = casadi.triu(casadi.hessian(lagrangian, variables)[0])
    known, once = [variables, given], {"cse": True}  # like terms are computed once
    return Kind(
        price=casadi.Function("price", known, [price], once),
        value=casadi.Function("value", known, [casadi.densify(rows)], once),
        slope=casadi.Function("slope", known, [_entries(casadi, jacobian)], once),
        curve=casadi.Function("curve", [*known, *weights], [_entries(casadi, hessian)], once),
        jacobian=_places(jacobian),
        hessian=_places(hessian),
        size=variables.numel(),
        given=given.numel(),
        limits=limits,
        is_priced=not price.is_zero(),
    )


def _entries(casadi: Any, matrix: Any) -> Any:
    """Nonzero entries of a matrix as a dense column."""
    return casadi.vertcat(casadi.SX(0, 1), *matrix.nonzeros())


def _places(matrix: Any) -> tuple[IntArray, IntArray]:
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


def assembled(
    casadi: Any, blocks: Sequence[Blocks], *, size: int, given: int
) -> tuple[dict[str, Any], dict[str, Any], Array]:
    """The program of `size` variables and so many parameters that blocks add up to.

    Its functions x, p, f, g in symbols, their derivatives as options of ``casadi.nlpsol``, and
    limits (rows, 2).
    """
    x, p = casadi.MX.sym("x", size), casadi.MX.sym("p", given)
    limits = np.concatenate([np.tile(one.kind.limits, (one.number, 1)) for one in blocks])
    of_f, of_g = casadi.MX.sym("lam_f"), casadi.MX.sym("lam_g", len(limits))
    price, rows, entries, curves = casadi.MX(0.0), [], [], []
    of_entries, of_curves = list[IntArray](), list[IntArray]()  # (2, n) row and column of each
    first = 0
    for one in blocks:
        kind, count, last = one.kind, one.number, first + one.rows
        taken = casadi.reshape(x[one.variables.ravel("F").tolist()], kind.size, count)
        if one.given.dtype.kind == "i":  # places among the parameters
            known = casadi.reshape(p[one.given.ravel("F").tolist()], kind.given, count)
        else:
            known = casadi.MX(casadi.DM(one.given.reshape(kind.given, count)))
        if kind.is_priced:
            price += casadi.sum2(kind.price.map(count)(taken, known))
        weights = casadi.reshape(of_g[first:last], len(kind.limits), count)
        curve = kind.curve.map(count)(taken, known, casadi.repmat(of_f, 1, count), weights)
        rows.append(casadi.vec(kind.value.map(count)(taken, known)))
        entries.append(casadi.vec(kind.slope.map(count)(taken, known)))
        curves.append(casadi.vec(curve))
        row, column = kind.jacobian
        row = (first + len(kind.limits) * np.arange(count)[:, None] + row).ravel()
        of_entries.append(np.array([row, one.variables[column].ravel("F")]))
        both = np.array([one.variables[place].ravel("F") for place in kind.hessian])
        of_curves.append(np.sort(both, axis=0))  # of the upper triangle
        first = last
    g = casadi.vertcat(*rows)
    jacobian = _matrix(casadi, entries, of_entries, first, size)
    hessian = _matrix(casadi, curves, of_curves, size, size)
    named = ["x", "p"], ["g", "jac_g_x"]
    of = ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
    derivatives = {  # not the gradient: IPOPT got numbers of it that were none (CasADi 3.8.2)
        "jac_g": casadi.Function("nlp_jac_g", [x, p], [g, jacobian], *named),
        "hess_lag": casadi.Function("nlp_hess_l", [x, p, of_f, of_g], [hessian], *of),
        "no_nlp_grad": True,  # nor are the multipliers of what is given asked for
        "calc_lam_p": False,
    }
    return {"x": x, "p": p, "f": price, "g": g}, derivatives, limits


def _matrix(
    casadi: Any, parts: Sequence[Any], places: Sequence[IntArray], rows: int, columns: int
) -> Any:
    """The sparse matrix that entries at some places (2, n), row and column, add up to."""
    entries, (row, column) = casadi.vertcat(*parts), np.concatenate(places, axis=1)
    keys, owner = np.unique(column * rows + row, return_inverse=True)
    begins = (
        np.searchsorted(keys // rows, np.arange(columns + 1))
        if len(keys)
        else np.zeros(columns + 1, dtype=np.int64)
    )
    sparsity = casadi.Sparsity(rows, columns, begins.tolist(), (keys % rows).tolist())
    if len(keys) == len(owner):  # each place once: they only change their order
        order = np.empty(len(keys), dtype=np.int64)
        order[owner] = np.arange(len(keys))
        return casadi.MX(sparsity, entries[order.tolist()])
    each = np.arange(len(owner) + 1).tolist()
    owned = casadi.Sparsity(len(keys), len(owner), each, owner.tolist())
    return casadi.MX(sparsity, casadi.MX(casadi.DM(owned, np.ones(len(owner)))) @ entries)
