"""The report on a record by `pyfric run` and `Record.summary`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from pyfric.display import plain
from pyfric.record.analysis import precursors
from pyfric.record.data import RecordData
from pyfric.record.measured import NOT_VERIFIED, Errors

MAIN_COLUMNS = (
    "event",
    "t_start",
    "t_stop",
    "L_p_over_L",
    "F_T_start_over_F_N",
    "F_T_arrest_over_F_N",
    "n_blocks",
    "nucleation_block",
    "is_precursor",
)
METHOD = ("engine", "geometry", "stepper", "switching", "rtol", "dt", "threads", "variant")


def summary(record: RecordData, files: list[Path]) -> dict[str, Any]:
    """Return the entries of the report of `pyfric run` by name, with None for unknown numbers."""
    events, F_N = record.events, record.scene.F_N
    main = events[events["is_main"]].reset_index()
    for name in ("F_T_start", "F_T_arrest"):
        main = main.assign(**{f"{name}_over_F_N": main[name] / F_N})
    last = record.curve.iloc[-1]
    return {
        "scene": record.scene.name,
        "status": record.status,
        "t": float(last["t"]),
        "F_T_over_F_N": float(last["F_T"] / F_N),
        "events": {
            "all": len(events),
            "main": len(main),
            "precursors": len(precursors(record)),
            "micro": len(events) - len(main),
        },
        "main_events": [
            plain({name: row[name] for name in MAIN_COLUMNS}) for _, row in main.iterrows()
        ],
        "timings": {name: float(value) for name, value in record.timings.items()},
        "method": {name: getattr(record.method, name) for name in METHOD}
        | {"words": str(record.method)},
        "counts": dict(record.counts),
        "notes": list(record.notes),
        "errors": _errors(record.errors),
        "files": [str(path) for path in files],
    }


def _errors(errors: Errors | None) -> dict[str, Any]:
    """Return measured errors and their verdict by name, with None for errors not measured."""
    if errors is None:
        return {"measured": None, "holds": None, "text": NOT_VERIFIED}
    verdict = {"measured": errors.measured(), "holds": errors.holds, "text": str(errors)}
    return dataclasses.asdict(errors) | verdict


def numbered(n: int, name: str) -> str:
    """Return a number with a noun, such as "1 event" or "3 events"."""
    return f"{n} {name}{'s' if n != 1 else ''}"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def text(summary: dict[str, Any]) -> str:
    events, timings, method = summary["events"], dict(summary["timings"]), summary["method"]
    per_step = timings.pop("per_block_and_step", None)
    took = ", ".join(f"{name} {value:.2f} s" for name, value in timings.items())
    status, _, why = summary["status"].partition(": ")
    lines = [
        f"{summary['scene'] or 'run'}: {status} at t = {summary['t']:.6g} s, "
        f"F_T/F_N = {summary['F_T_over_F_N']:.4f}",
        *([why] if why else []),
        f"events: {events['main']} main, of which {numbered(events['precursors'], 'precursor')}; "
        f"{numbered(events['micro'], 'micro-slip')}",
    ]
    if summary["main_events"]:
        lines += ["", f"event  {'t (s)':>10}  {'L_p/L':>6}  {'F_T/F_N':>8}  {'blocks':>6}"]
    for event in summary["main_events"]:
        numbers = (
            _number(event[name], form).rjust(width)
            for name, form, width in (
                ("t_start", ".6f", 10),
                ("L_p_over_L", ".3f", 6),
                ("F_T_start_over_F_N", ".4f", 8),
                ("n_blocks", "d", 6),
            )
        )
        lines.append("  ".join([f"{event['event']:>5}", *numbers]))
    if summary["main_events"]:
        lines.append("")
    variant = [f"variant {method['variant']}"] if method["variant"] else []
    words = [method["words"], *variant, numbered(method["threads"], "thread")]
    lines += [", ".join(words), f"time taken: {took}"]
    if per_step is not None:
        lines.append(f"per block and step: {per_step * 1e9:.1f} ns")
    lines.append(summary["errors"]["text"])
    lines += [f"note: {note}" for note in summary["notes"]]
    return "\n".join([*lines, *(f"written: {path}" for path in summary["files"])])
