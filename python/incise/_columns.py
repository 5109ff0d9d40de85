# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tables, rows of them and logs of ticks as DataFrames, xarray, plots and HTML."""

from __future__ import annotations

import re
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Tuple

from ._library import package

_AXES = {3: "xyz", 4: "wxyz"}


def unit_of(name: str) -> str:
    """The unit that a column's name ends with; 1 without one."""
    found = re.search(r"_(mm_s2|mm_s|mm|N|ns|s|Hz|px|deg|V|mV)$", name)
    return found.group(1).replace("_", "/").replace("s2", "s²") if found else "1"


class Tabular:
    """Columns with units, some of them with times."""

    columns: Any  #: the names of the columns
    metadata: Any  #: where the rows come from
    numpy: Callable[[], Dict[str, Any]]
    _head: Callable[[], Tuple[Mapping[str, Any], str]]  # the first rows, and a caption
    _start_ns: Optional[Callable[[], int]] = None  # zero of the times, else the first

    def units(self) -> Dict[str, str]:
        """The unit of each column."""
        return {name: unit_of(name) for name in self.columns}

    def seconds(self, arrays: Mapping[str, Any]) -> Any:
        """Times of rows in seconds from the start of the recording or run; None: they have none."""
        if "t_ns" not in arrays:
            return arrays.get("t_s")
        t_ns = arrays["t_ns"]
        start = self._start_ns() if self._start_ns else t_ns[0] if len(t_ns) else 0
        return (t_ns - start) * 1e-9

    def _flat(self) -> Iterator[Tuple[str, Any, str]]:
        """Columns with units; a vector is a column for each axis."""
        units = self.units()
        for name, values in self.numpy().items():
            if getattr(values, "ndim", 1) == 1:
                yield name, values, units[name]
                continue
            for i in range(values.shape[1]):
                axis = _AXES.get(values.shape[1], "0123456789")[i]
                yield f"{name}_{axis}", values[:, i], units[name]

    def to_pandas(self) -> Any:
        """A DataFrame; the index is the time since the start, where rows have one. Units and
        provenance are in its ``attrs``."""
        pandas = package("pandas", "to_pandas()")
        flat = list(self._flat())
        frame = pandas.DataFrame({name: values for name, values, _ in flat})
        seconds = self.seconds(frame)
        if seconds is not None:
            t_ns = (seconds * 1e9).round().astype("int64").to_numpy()
            frame.index = pandas.to_timedelta(t_ns, unit="ns").rename("t")
        frame.attrs["units"] = {name: unit for name, _, unit in flat}
        frame.attrs["provenance"] = dict(self.metadata)
        return frame

    def xarray(self) -> Any:
        """An xarray.Dataset with units, over t in seconds where rows have a time."""
        xarray = package("xarray", "xarray()")
        flat = list(self._flat())
        seconds = self.seconds({name: values for name, values, _ in flat})
        axis = "row" if seconds is None else "t"
        return xarray.Dataset(
            {name: (axis, values, {"units": unit}) for name, values, unit in flat},
            {} if seconds is None else {"t": ("t", seconds, {"units": "s"})},
            dict(self.metadata),
        )

    def plot(self, *columns: str, ax: Any = None) -> Any:
        """Plot columns over time, axes for each unit; without names forces and lengths. Pairs without
        a time: force over depth, coloured by the velocity. Returns the matplotlib axes."""
        from ._show import plot_columns

        return plot_columns(self, columns, ax)

    def _repr_html_(self) -> str:
        from ._show import html_table

        rows, caption = self._head()
        units = self.units()
        return html_table(
            caption,
            [f"{name} / {units[name]}" if units[name] != "1" else name for name in rows],
            zip(*rows.values()),
        )


class Columns(Tabular, Dict[str, Any]):
    """{column: array}: rows of a table, or the ticks of a run."""

    def __init__(self, arrays: Mapping[str, Any], about: str = "rows", like: Any = None):
        """like: the table that the rows are of."""
        super().__init__(arrays)
        self._about = about
        self.metadata: Mapping[str, str] = like.metadata if like else {}
        self._units: Mapping[str, str] = like.units() if like else {}
        self._start_ns = like and like._start_ns

    @property
    def columns(self) -> List[str]:  # type: ignore[override]
        """The names of the columns."""
        return list(self)

    def units(self) -> Dict[str, str]:
        """The unit of each column."""
        return {name: self._units.get(name) or unit_of(name) for name in self}

    def numpy(self) -> Dict[str, Any]:
        """The columns themselves."""
        return self

    def _length(self) -> int:
        return len(next(iter(self.values()), ()))

    def __repr__(self) -> str:
        return f"<incise.Columns {self._about}: {self._length()} rows of {', '.join(self)}>"

    def _head(self) -> Tuple[Mapping[str, Any], str]:
        return {
            name: values[:8] for name, values in self.items()
        }, f"{self._length()} {self._about}"
