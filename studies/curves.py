"""Nine public curves of a slider of paper on paper: coefficients of each, and one law for all.

The slider of 30.7 g is pulled by a spring of k = 168, 1002 or 2254 N/m at V = 42, 1100 or 4300
um/s; F/(m g) is sampled at 2 kHz. Its events do not repeat, so they are compared as a population
(`pyfric.fitting.Sizes`): mean forces at the start and end of large events, and recurrence. The
model is a stiff slider on the spring.

The curves are those of J. Colas, N. Pustelnik, C. Oliver, P. Abry, J.-C. Geminard, V. Vidal,
accepted by Phys. Rev. E in 2019. pyfric does not include the curves; `SOURCE` gives their address.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sizes import size, tiny

import pyfric
from pyfric.fitting import Sizes, fit
from pyfric.fitting.measurement import At
from pyfric.measured import Curve, read
from pyfric.values import write

__all__ = ["add_source", "one_law", "report", "report_of_laws", "study", "wanted"]

SOURCE = {
    "repository": "data_raw of npusteln/stickslip on GitHub",
    "commit": "84acb9815970600307a3edb4758b1594fb7f2e1c",
    "commit_date": "2019-08-30",
    "licence": "CeCILL-B",
}
M, G = 30.7e-3, 9.81
STIFFNESSES, SPEEDS = size((168, 1002, 2254), (168,)), size((42, 1100, 4300), (1100,))
"""Stiffnesses of the spring, N/m, and speeds of its end, um/s."""
BOUNDS = size({"mu_s": (0.2, 0.7), "mu_k": (0.1, 0.65)}, {"mu_s": (0.3, 0.5)})
HOW = {"fidelity": "hybrid", "geometry": "linear"}
RATE = size(2000, 500)
"""Samples per second of a synthetic curve."""
PARTS = 20
"""Parts of a curve whose means give the error of its mean."""


def slider(k: float, V: float, **changes: Any) -> pyfric.Scene:
    """Return a stiff slider on a spring: two blocks under a plate, which move as one.

    Their bond is as stiff as some 40 steps in the oscillation of an event allow.
    """
    given = {"mu_s": 0.36, "mu_k": 0.32} | changes
    return pyfric.chain(
        L=0.08, l=0.04, F_N=M * G, K=k, V=V * 1e-6, M=M, k=60 * k, side="top", **given
    )


def found_in(folder: Path | None) -> Iterator[tuple[int, int, Curve]]:
    """Yield stiffness, speed and curve of each file; a synthetic curve at tiny sizes."""
    for k in STIFFNESSES:
        for V in SPEEDS:
            if folder is None:
                yield k, V, made(k, V)
                continue
            columns = {"t": "t", "mu": "Fnorm"}
            path = folder / f"k{k}Nm_v{V}.mat"
            yield k, V, read(path, columns=columns, units={"t": "s", "mu": "1"}, F_N=M * G)


def made(k: float, V: float, n: int = 9, seed: int = 0) -> Curve:
    """Return a curve of a block with a new strength in each event, in closed form.

    The block sticks until F/F_N reaches the strength, and swings about mu_k for half a period.
    """
    rng, rate = np.random.default_rng(seed), k * V * 1e-6 / (M * G)
    strength, mu_k, half = 0.38 + 0.015 * rng.standard_normal(n), 0.32, np.pi * np.sqrt(M / k)
    t, f = [0.0], [0.25]
    for peak in strength:
        t.append(t[-1] + (peak - f[-1]) / rate)
        f.append(peak)
        swing = np.linspace(0.0, np.pi, 30)[1:]
        t += (t[-1] + half * swing / np.pi).tolist()
        f += (mu_k + (peak - mu_k) * np.cos(swing)).tolist()
    times = np.arange(0.0, t[-1], 1 / RATE)
    mu = np.interp(times, t, f) + 1e-3 * rng.standard_normal(len(times))
    return Curve.of(t=times, mu=mu, F_N=M * G)


def study(folder: Path | None, out: Path, say: Callable[[str], None] = print) -> pd.DataFrame:
    """Return a row for each curve; rows that are missing in the file are made and added to it."""
    path = out / "curves.csv"
    rows = pd.read_csv(path).to_dict("records") if path.exists() else []
    known = {(row["k"], row["V"]) for row in rows}
    for k, V, curve in found_in(folder):
        if (k, V) not in known:
            say(f"k = {k} N/m, V = {V} um/s")
            rows.append({"k": k, "V": V} | row_of(slider(k, V), curve))
            pd.DataFrame(rows).to_csv(path, index=False, float_format="%.5g")
    return pd.DataFrame(rows)


def row_of(scene: pyfric.Scene, curve: Curve) -> dict[str, Any]:
    """Return the population of events of a curve, and the coefficients that fit it."""
    start, sizes = time.process_time(), Sizes(curve, spreads=False)
    table = sizes.whole
    row = population(table, sizes)
    means = np.array([part.mean() for part in np.array_split(curve.over_F_N, PARTS)])
    row |= {"force": means.mean(), "force_error": error_of_mean(means)}
    row["stuck"] = float(table["rate"].median()) / (scene.driver.K * scene.driver.V / scene.F_N)
    found = fit(scene, sizes, BOUNDS, **HOW)
    for name, value in found.values.items():
        low, high = found.intervals[name]
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    row |= {"chi2": found.chi2, "dof": found.dof, "off": found.model_error, "runs": found.runs}
    return row | {"seconds": time.process_time() - start}


def population(table: pd.DataFrame, sizes: Sizes) -> dict[str, float]:
    """Return means, spreads and correlations of forces and recurrence of large events."""
    known = sizes.table(table.iloc[:0], At({})).set_index("at")
    row: dict[str, float] = {"events": len(table), "noise": table.attrs["noise"]}
    part = table[table["drop"] >= 0.2 * table["drop"].max()]
    row["large"] = len(part)
    names = {"mean peak": "peak", "mean valley": "valley", "recurrence": "recurrence"}
    names |= {"spread of peaks": "peak_std", "spread of valleys": "valley_std"}
    for name, short in names.items():
        row |= {short: known.at[name, "measured"], f"{short}_error": known.at[name, "error"]}
    waits = part["t_start"].diff()
    row["recurrence_std"] = float(waits.std())
    row["follow"] = float(part["peak"].corr(part["peak"].shift()))
    row["peak_valley"] = float(part["peak"].corr(part["valley"]))
    row["half_drop_error"] = error_of_mean(0.5 * part["drop"].to_numpy())
    return row | {"wait_peak": float(waits.corr(part["peak"] - part["valley"].shift()))}


def error_of_mean(values: np.ndarray) -> float:
    """Return the standard error of the mean of a series of correlated numbers."""
    one_on = max(float(np.corrcoef(values[1:], values[:-1])[0, 1]), 0.0)
    return float(values.std(ddof=1) * np.sqrt((1 + one_on) / (1 - one_on) / len(values)))


def one_law(table: pd.DataFrame) -> pd.DataFrame:
    """Return differences between curves of quantities that are equal under one law.

    Coulomb friction fixes mu_s and mu_k. If each curve has a separate level of friction (humidity,
    wear, the zero of the sensor), Coulomb friction fixes mu_s - mu_k. A law of speed and its
    history, such as rate and state, fixes the mean force of a slider that slides at one speed.
    """
    rows = []
    level = np.hypot(table["peak_error"], table["valley_error"]) / 2
    asked = {("mu_s", "all"): (table["mu_s"], table["peak_error"])}
    if "mu_k" in table:
        asked["mu_k", "all"] = table["mu_k"], level
        apart = table["mu_s"] - table["mu_k"]
        asked["mu_s - mu_k", "all"] = apart, table["half_drop_error"]
    for V, part in table.groupby("V"):
        asked["mean force", f"V = {V} um/s"] = part["force"], part["force_error"]
    for (number, curves), (values, errors) in asked.items():
        weights = 1 / errors**2
        mean = float((weights * values).sum() / weights.sum())
        row = {"number": number, "curves": curves, "mean": mean, "std": float(values.std())}
        row["error"] = float(np.sqrt((errors**2).mean()))
        row |= {"chi2": float((((values - mean) / errors) ** 2).sum()), "dof": len(values) - 1}
        rows.append(row)
    return pd.DataFrame(rows)


def report(table: pd.DataFrame) -> str:
    """Return the coefficients of each curve."""
    lines = []
    for _, row in table.iterrows():
        said = f"k = {row['k']:.0f} N/m, V = {row['V']:.0f} um/s: {row['large']:.0f} large events"
        for name in BOUNDS:
            ends = f"{row[f'{name}_low']:.3f} to {row[f'{name}_high']:.3f}"
            said += f", {name} = {row[name]:.3f} ({ends})"
        lines.append(f"{said}, chi^2 {row['chi2']:.3g} with {row['dof']:.0f}")
    return "\n".join(lines)


def report_of_laws(table: pd.DataFrame) -> str:
    """Return the differences of curves from one law as text."""
    return "\n".join(
        f"{row['number']} of {row['curves']}: {row['mean']:.3f}, from curve to curve "
        f"+- {row['std']:.3f}, each known to {row['error']:.3f}, chi^2 {row['chi2']:.3g} "
        f"with {row['dof']} degrees of freedom"
        for _, row in table.iterrows()
    )


def wanted(folder: Path | None) -> str:
    """Return a message if the curves are missing, otherwise ""."""
    if tiny() or (folder is not None and any(folder.glob("k*Nm_v*.mat"))):
        return ""
    where = f"{SOURCE['repository']}, commit {SOURCE['commit'][:7]}"
    return f"skipped, as there are no curves: --data takes a copy of the folder {where}"


def add_source(path: Path) -> None:
    """Add the source of the curves to a provenance."""
    lines = [f'{name} = "{value}"' for name, value in SOURCE.items()]
    write(path, (path.read_text() + "\n".join(["", "[curves]", *lines, ""])).encode())
