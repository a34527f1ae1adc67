"""What explains the speed of fronts: the prestress, or the position along the front.

Each is taken as a curve of y = ln v_c, constant in bins of equal numbers of points and fitted by
least squares, and both together as the sum of two curves. A fit explains the share

    R^2 = 1 - sum (y - fit)^2 / sum (y - mean)^2,

and the prestress s explains, of what the position x leaves, the partial share

    (R^2(s and x) - R^2(x)) / (1 - R^2(x)).

Speeds along a front resemble each other: what is drawn by chance is a front, never a block.
Intervals are those of a bootstrap over fronts. Data that know the position alone are the curve over
the position plus what is left of it, with one random sign for each front.

Sources: B. Efron, Ann. Statist. 7, 1 (1979), the bootstrap; A. C. Cameron, J. B. Gelbach and
D. L. Miller, Rev. Econ. Stat. 90, 414 (2008), signs by groups of dependent points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

__all__ = ["DRAWS", "position_alone", "shares", "told"]

BINS = 10
"""Bins of a curve."""
DRAWS = 399
"""Draws of the bootstrap, and of data that know the position alone."""
INTERVAL = 0.025, 0.975
"""Ends of the interval that holds 95 % of the bootstrap."""
ZERO = 1e-10
"""Eigenvalues below this share of the largest are 0: two curves have a constant in common."""


def shares(points: pd.DataFrame, prestress: str, by: str = "") -> pd.DataFrame:
    """Return what prestress and position explain of ln v_c.

    Args:
        points: one row for each block of a front: v_c; the prestress; place, the position along
            the front, over its length; front, which front it is.
        prestress: the column of the prestress.
        by: column by which the points are divided; each group has curves of its own.

    Returns:
        Columns: prestress and position, what each explains; beyond, the partial share of the
        prestress; more, what the prestress explains more than the position. Rows: value; low and
        high, ends of its 95 % interval; null, the largest where data know the position alone.
    """
    y, front, groups = _prepared(points, prestress, by)
    rng, once, count = np.random.default_rng(0), np.ones((1, y.size)), front.max() + 1
    drawn = rng.multinomial(count, np.full(count, 1 / count), DRAWS)
    signed = _signed(y, front, groups, rng, DRAWS)
    value = _explained(y[None], groups, once)
    bootstrap = _explained(y[None], groups, drawn[:, front].astype(float))
    rows = [*value.to_numpy(), *bootstrap.quantile(INTERVAL).to_numpy()]
    rows.append(_explained(signed, groups, once).max())
    return pd.DataFrame(np.array(rows), ["value", "low", "high", "null"], value.columns)


def told(found: pd.DataFrame, share: str) -> str:
    """Return a share in words: value and interval."""
    return "{value:.2f} ({low:.2f} to {high:.2f})".format(**found[share])


def position_alone(points: pd.DataFrame, by: str = "") -> pd.DataFrame:
    """Return points whose speeds know the position along the front, nothing of the prestress."""
    y, front, groups = _prepared(points, "place", by)
    signed = _signed(y, front, groups, np.random.default_rng(0), 1)
    return points.assign(v_c=np.exp(np.log(points["v_c"]).mean() + signed[0]))


class _Group(NamedTuple):
    """Points with curves of their own: their rows, and which bin of s and of x each lies in.

    Bins are columns that are 1 in the bin and 0 elsewhere.
    """

    rows: np.ndarray
    s: np.ndarray
    x: np.ndarray


def _prepared(
    points: pd.DataFrame, prestress: str, by: str
) -> tuple[np.ndarray, np.ndarray, list[_Group]]:
    """ln v_c about its mean, the number of the front, and the groups."""
    y = np.log(points["v_c"].to_numpy())
    every = points.groupby(by).indices.values() if by else [np.arange(y.size)]
    groups = [
        _Group(rows, *(_bins(points[name].to_numpy()[rows]) for name in (prestress, "place")))
        for rows in every
    ]
    return y - y.mean(), pd.factorize(points["front"])[0], groups


def _bins(x: np.ndarray) -> np.ndarray:
    return pd.get_dummies(pd.qcut(x, BINS, labels=False, duplicates="drop")).to_numpy(float)


def _signed(
    y: np.ndarray, front: np.ndarray, groups: list[_Group], rng: np.random.Generator, draws: int
) -> np.ndarray:
    """The curve over the position, and what is left with random signs; shape (draws, points)."""
    curve = np.empty_like(y)
    for rows, _, x in groups:
        curve[rows] = x @ np.linalg.lstsq(x, y[rows], rcond=None)[0]
    signs = rng.choice([-1.0, 1.0], (draws, front.max() + 1))
    return curve + signs[:, front] * (y - curve)


def _explained(y: np.ndarray, groups: list[_Group], weight: np.ndarray) -> pd.DataFrame:
    """Shares for each row of y or of the weights, shape (draws or 1, points)."""
    mean = (weight * y).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    left = sum(
        np.array([_left(y[:, rows], fit, weight[:, rows]) for fit in (s, x, np.hstack([s, x]))])
        for rows, s, x in groups
    )
    s, x, both = 1 - left / (weight * (y - mean) ** 2).sum(axis=1)
    shares = {"prestress": s, "position": x, "beyond": (both - x) / (1 - x), "more": s - x}
    return pd.DataFrame(shares)


def _left(y: np.ndarray, columns: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Sum of squares that a weighted fit by columns leaves, for each row of y or weights."""
    normal = np.einsum("dn,na,nb->dab", weight, columns, columns, optimize=True)
    right = (weight * y) @ columns
    fit = np.linalg.pinv(normal, rcond=ZERO, hermitian=True) @ right[:, :, None]
    return (weight * y**2).sum(axis=1) - (right * fit[:, :, 0]).sum(axis=1)
