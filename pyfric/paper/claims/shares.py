"""Shares of front speeds that prestress and position along the front explain.

y = ln v_c is fitted by least squares: by a curve of prestress, by a curve of position, or by the
sum of both curves. Curves are constant in bins with equal numbers of points. A fit explains the
share

    R^2 = 1 - sum (y - fit)^2 / sum (y - mean)^2 .

Of the variance that the position x leaves, the prestress s explains the partial share

    (R^2(s and x) - R^2(x)) / (1 - R^2(x)).

This partial share is larger than the share of y minus the curve of x that a curve of s explains. If
s and x are correlated, the curve of x has already taken the part that both explain.

Speeds along a front are correlated. Intervals are therefore from a bootstrap over fronts.

Null data depend on the position alone. Null data keep the curve of the position and scatter its
residuals in one of two ways. Residuals are shuffled over all points, or get one random sign for
each front, which keeps the correlation along a front. Null data show the share that a prestress
explains only because it varies with the position.

Sources: B. Efron, Ann. Statist. 7, 1 (1979), the bootstrap; A. C. Cameron, J. B. Gelbach and
D. L. Miller, Rev. Econ. Stat. 90, 414 (2008), signs by groups of dependent points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

BINS = 10
"""Number of bins of a curve."""
DRAWS = 999
"""Number of draws of the bootstrap and of null data."""
INTERVAL = 0.025, 0.975
"""Ends of the interval that holds 95 % of the draws."""
SCATTER = ("shuffled", "signs")
"""Ways to scatter the residuals of the curve over the position."""
ZERO = 1e-10
"""Eigenvalues below this share of the largest count as 0. One eigenvalue is 0, because two curves
share a constant."""
Groups = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Groups of points with curves of their own: their rows, their bins of s, their bins of x. Bins are
columns that are 1 in the bin and 0 elsewhere."""


def shares(points: pd.DataFrame, prestress: str, by: str = "") -> pd.DataFrame:
    """Return the shares of ln v_c that prestress and position explain.

    Args:
        points: one row for each block of a front: v_c; the prestress; place, the position along the
            front over its length; front, the front.
        prestress: the column of the prestress.
        by: column by which the points are divided; each group has curves of its own.

    Returns:
        Columns: prestress and position, the share of each; beyond, the partial share of the
        prestress; after, its share of y minus the curve of the position; more, share of the
        prestress minus share of the position. Rows: value; low and high, ends of its 95 % interval;
        shuffled and signs, the upper ends of the intervals of null data; null, the larger of these
        two.
    """
    y, front, groups = _prepared(points, prestress, by)
    rng, once, count = np.random.default_rng(0), np.ones((1, y.size)), front.max() + 1
    drawn = rng.multinomial(count, np.full(count, 1 / count), DRAWS)
    low, high = INTERVAL
    bootstrap = _explained(y[None], groups, drawn[:, front].astype(float))
    rows = {
        "value": _explained(y[None], groups, once).iloc[0],
        "low": bootstrap.quantile(low),
        "high": bootstrap.quantile(high),
    }
    for scatter in SCATTER:
        alone = _alone(y, front, groups, scatter, DRAWS)
        rows[scatter] = _explained(alone, groups, once).quantile(high)
    found = pd.DataFrame(rows).T
    found.loc["null"] = found.loc[list(SCATTER)].max()
    return found


def told(found: pd.DataFrame, share: str) -> str:
    """Return a share as text: value and interval."""
    return "{value:.2f} ({low:.2f} to {high:.2f})".format(**found[share])


def position_alone(points: pd.DataFrame, by: str = "", scatter: str = "signs") -> pd.DataFrame:
    """Return null data: points whose speeds depend on the position along the front alone.

    Args:
        points, by: as for `shares`.
        scatter: one of `SCATTER`.
    """
    y, front, groups = _prepared(points, "place", by)
    alone = _alone(y, front, groups, scatter, 1)[0]
    return points.assign(v_c=np.exp(np.log(points["v_c"]).mean() + alone))


def _prepared(
    points: pd.DataFrame, prestress: str, by: str
) -> tuple[np.ndarray, np.ndarray, Groups]:
    """Return ln v_c minus its mean, the number of the front of each point, and the groups."""
    y = np.log(points["v_c"].to_numpy())
    every = points.groupby(by).indices.values() if by else [np.arange(y.size)]
    groups = [
        (rows, *(_bins(points[name].to_numpy()[rows]) for name in (prestress, "place")))
        for rows in every
    ]
    return y - y.mean(), pd.factorize(points["front"])[0], groups


def _bins(x: np.ndarray) -> np.ndarray:
    return pd.get_dummies(pd.qcut(x, BINS, labels=False, duplicates="drop")).to_numpy(float)


def _alone(
    y: np.ndarray, front: np.ndarray, groups: Groups, scatter: str, draws: int
) -> np.ndarray:
    """Return null data, (draws, points): the curve over the position plus scattered residuals."""
    rng, made = np.random.default_rng(0), np.empty((draws, y.size))
    signs = rng.choice([-1.0, 1.0], (draws, front.max() + 1))
    for rows, _, x in groups:
        curve = x @ np.linalg.lstsq(x, y[rows], rcond=None)[0]
        left = np.broadcast_to(y[rows] - curve, (draws, rows.size))
        left = signs[:, front[rows]] * left if scatter == "signs" else rng.permuted(left, axis=1)
        made[:, rows] = curve + left
    return made


def _explained(y: np.ndarray, groups: Groups, weight: np.ndarray) -> pd.DataFrame:
    """Return shares explained, a row for each row of y or of weights, both (draws or 1, points).

    With weights W, bins A and c = A'W1, a curve has the values A'Wy/c and explains (A'Wy)^2/c of
    y'Wy. The residuals of the curve of x are explained by a curve of s, or by the residuals of the
    bins of s over x (theorem of Frisch and Waugh).
    """
    weighted = weight * y
    squares = (weighted * y).sum(axis=1)
    explained: Any = 0.0
    for rows, s, x in groups:
        w, wy = weight[:, rows], weighted[:, rows]
        (c_s, c_x), (r_s, r_x) = ((v @ s, v @ x) for v in (w, wy))
        shared = np.einsum("dn,na,nb->dab", w, s, x, optimize=True)
        of_x = _over(shared, c_x[:, None])
        after = r_s - (of_x @ r_x[:, :, None])[:, :, 0]
        normal = c_s[:, :, None] * np.eye(s.shape[1]) - of_x @ shared.transpose(0, 2, 1)
        fit = (np.linalg.pinv(normal, rcond=ZERO, hermitian=True) @ after[:, :, None])[:, :, 0]
        parts = _over(r_s**2, c_s), _over(r_x**2, c_x), fit * after, _over(after**2, c_s)
        explained = explained + np.array([part.sum(axis=1) for part in parts])
    by_s, by_x, beyond, by_s_after = explained
    whole = squares - weighted.sum(axis=1) ** 2 / weight.sum(axis=1)
    prestress, position = (1 - (squares - part) / whole for part in (by_s, by_x))
    left = squares - by_x
    return pd.DataFrame(
        {
            "prestress": prestress,
            "position": position,
            "beyond": beyond / left,
            "after": by_s_after / left,
            "more": prestress - position,
        }
    )


def _over(x: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return x over the weight in each bin, 0 in empty bins."""
    return np.divide(
        x, count, out=np.zeros(np.broadcast_shapes(x.shape, count.shape)), where=count > 0
    )
