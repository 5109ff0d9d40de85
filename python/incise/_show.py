# SPDX-License-Identifier: LGPL-2.1-or-later
"""Plots by matplotlib, and tables in HTML for notebooks."""

from __future__ import annotations

import html
import re
from typing import Any, Iterable, Optional, Sequence, Tuple

from ._columns import Tabular, unit_of
from ._library import Invalid, package


def html_table(caption: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table; numbers have six digits."""

    def cell(value: Any) -> str:
        return f"{value:.6g}" if isinstance(value, float) else str(value)

    def line(kind: str, values: Iterable[Any]) -> str:
        cells = "".join(f"<{kind}>{html.escape(cell(value))}</{kind}>" for value in values)
        return f"<tr>{cells}</tr>"

    body = "".join(line("td", row) for row in rows)
    return (
        f"<table><caption>{html.escape(caption)}</caption>"
        f"<thead>{line('th', header)}</thead><tbody>{body}</tbody></table>"
    )


def _axes(n: int, ax: Any, **options: Any) -> Any:
    """n axes, one below the other; or the one that was given, n times."""
    if ax is not None:
        return [ax] * n
    pyplot = package("matplotlib.pyplot", "plot()")
    _, axes = pyplot.subplots(n, squeeze=False, layout="constrained", **options)
    return list(axes[:, 0])


def _label(name: str, unit: Optional[str] = None) -> str:
    """ "force / N" of force_N."""
    unit = unit_of(name) if unit is None else unit
    end = "_" + unit.replace("/", "_").replace("²", "2")
    plain = name[: -len(end)] if name.endswith(end) else name
    plain = plain.replace("_", " ")
    return plain if unit == "1" else f"{plain} / {unit}"


def _plot_pairs(table: Any, arrays: Any, ax: Any) -> Any:
    """Force over depth of averaged pairs."""
    (axis,) = _axes(1, ax)
    points = axis.scatter(
        arrays["depth_mm"], arrays["force_N"], c=arrays["velocity_mm_s"], s=12, cmap="viridis"
    )
    axis.figure.colorbar(points, ax=axis, label="velocity / mm/s")
    axis.set(xlabel="depth / mm", ylabel="force / N", title=table._about)
    return axis


def plot_columns(table: Any, names: Sequence[str], ax: Any) -> Any:
    """Tabular.plot()."""
    flat = {name: (values, unit) for name, values, unit in table._flat()}
    arrays = {name: values for name, (values, _) in flat.items()}
    seconds = table.seconds(arrays)
    if seconds is None and not names and {"depth_mm", "velocity_mm_s", "force_N"} <= set(flat):
        return _plot_pairs(table, arrays, ax)
    chosen = [n for n in flat if n in names or re.sub("_[wxyz0-9]$", "", n) in names]
    if not names:
        chosen = [name for name, (_, unit) in flat.items() if unit in ("N", "mm")]
        chosen = [name for name in chosen if "_u_" not in name and "_sd_" not in name]
    if not chosen:
        raise Invalid(22, f"plot: none of the columns; the columns are: {', '.join(flat)}")
    units = list(dict.fromkeys(flat[name][1] for name in chosen))
    axes = _axes(len(units), ax, sharex=True)
    for name in chosen:
        values, unit = flat[name]
        axis = axes[units.index(unit)]
        axis.plot(
            range(len(values)) if seconds is None else seconds, values, label=_label(name, unit)
        )
    for axis in axes:
        axis.legend()
    axes[0].set_title(table._about)
    axes[-1].set_xlabel("row" if seconds is None else "time / s")
    return axes[0] if len(axes) == 1 else axes


def plot_model(model: Any, data: Any, ax: Any) -> Any:
    """Model.plot()."""
    numpy = package("numpy", "plot()")
    inputs, output = model.inputs, model.output
    first, middle = inputs[0], [(v.min + v.max) / 2 for v in inputs]
    x = numpy.linspace(first.min, first.max, 200)
    axes = _axes(1 if data is None else 2, ax, sharex=True)
    for share in (0.1, 0.5, 0.9) if len(inputs) > 1 else (0.5,):
        at = numpy.tile(middle, (len(x), 1))
        at[:, 0] = x
        label = None
        if len(inputs) > 1:
            second = inputs[1]
            at[:, 1] = second.min + share * (second.max - second.min)
            label = f"{_label(second.name)}: {at[0, 1]:.3g}"
        (line,) = axes[0].plot(x, model(at), label=label)
        if model._uncertainty:
            y, sd = model(at, sd=True)
            band = (y - 1.96 * sd, y + 1.96 * sd)
            axes[0].fill_between(x, *band, color=line.get_color(), alpha=0.15, linewidth=0)
    axes[0].set(xlabel=_label(first.name), ylabel=_label(output.name))
    if len(inputs) > 1:
        axes[0].legend()
    if data is None:
        return axes[0]
    depth, residual = _residuals(model, data)
    axes[1].plot(depth, residual, ".", markersize=3)
    axes[1].axhline(0, color="0.5", linewidth=0.8)
    axes[1].set(xlabel=_label(first.name), ylabel=f"residual of {_label(output.name)}")
    return axes


def _residuals(model: Any, data: Any) -> Tuple[Any, Any]:
    """The first input and the residuals of a table."""
    numpy = package("numpy", "plot()")
    names = [variable.name for variable in (*model.inputs, model.output)]
    arrays = data.numpy() if isinstance(data, Tabular) else data
    use = numpy.asarray(arrays["advancing"], bool) if "advancing" in arrays else slice(None)
    rows = {name: numpy.asarray(arrays[name])[use] for name in names}
    return rows[names[0]], rows[names[-1]] - model(rows)
