# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tables that the C library streams: to Arrow without a copy, to numpy and pandas.

A :class:`Table` names rows; each reading of it starts anew, so it may be read as often as one likes:

    pyarrow.table(rec.force)            polars.DataFrame(rec.force)
    rec.force["force_N"]                rec.force.to_pandas()
    rec.force.between(10, 20).plot()    rec.force.parquet("force.parquet")
"""

from __future__ import annotations

import ctypes
import errno
import itertools
import operator
import os
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, TYPE_CHECKING, Tuple
from typing import Union, overload

from . import _library
from ._columns import Columns, Tabular
from ._library import ArrowArray, ArrowArrayStream, ArrowSchema, Error, Invalid, PathLike, function
from ._library import make_error, package

if TYPE_CHECKING:
    from numpy.typing import NDArray

_ctypes_of = {
    "l": ctypes.c_int64,
    "i": ctypes.c_int32,
    "g": ctypes.c_double,
    "f": ctypes.c_float,
}
_numpy_of = {"l": "i8", "i": "i4", "g": "f8", "f": "f4"}


class Field(NamedTuple):
    """A column: its name, Arrow's format letter, unit, description and other metadata."""

    name: str
    format: str
    unit: str
    description: str
    metadata: Dict[str, str]


def _metadata(address: Optional[int]) -> Dict[str, str]:
    """Decode the metadata of an ArrowSchema."""
    pairs: Dict[str, str] = {}
    if not address:
        return pairs

    def number(at: int) -> int:
        return ctypes.c_int32.from_address(at).value

    count, at = number(address), address + 4
    for _ in range(count):
        words = []
        for _ in range(2):
            length = number(at)
            words.append(_library.text(ctypes.string_at(at + 4, length)))
            at += 4 + length
        pairs[words[0]] = words[1]
    return pairs


def _fields(schema: ArrowSchema) -> List[Field]:
    fields = []
    for i in range(schema.n_children):
        child = schema.children[i].contents
        metadata = _metadata(child.metadata)
        fields.append(
            Field(
                _library.text(child.name),
                _library.text(child.format),
                metadata.pop("unit", "1"),
                metadata.pop("description", ""),
                metadata,
            )
        )
    return fields


class _Reader:
    """An open ArrowArrayStream, which it releases."""

    def __init__(self, open_stream: Callable[[ArrowArrayStream], None]):
        self.stream = ArrowArrayStream()
        open_stream(self.stream)
        self.ref = self.stream

    def _check(self, code: int) -> None:
        if code:
            said = self.stream.get_last_error(self.ref)
            raise make_error(code, _library.text(said or b""))

    def schema(self):
        """The fields and the table's metadata."""
        schema = ArrowSchema()
        self._check(self.stream.get_schema(self.ref, schema))
        try:
            return _fields(schema), _metadata(schema.metadata)
        finally:
            schema.release(schema)

    def next(self) -> Optional[ArrowArray]:
        array = ArrowArray()
        self._check(self.stream.get_next(self.ref, array))
        return array if array.release else None

    def close(self) -> None:
        if self.stream.release:
            self.stream.release(self.ref)

    def __del__(self):
        self.close()


class Batch:
    """Some rows of a table. Views of its columns keep it alive; nothing is copied."""

    def __init__(self) -> None:
        raise TypeError("a Batch comes of a table: table.batches()")

    @classmethod
    def _of(cls, array: ArrowArray, fields: List[Field]) -> "Batch":
        batch = cls.__new__(cls)
        batch._array = array
        batch.fields = fields
        return batch

    def __len__(self) -> int:
        return self._array.length

    def __del__(self, byref=ctypes.byref):
        array = getattr(self, "_array", None)
        if array is not None and array.release:
            array.release(byref(array))

    def __reduce__(self) -> Any:
        raise TypeError("a Batch cannot be copied or pickled; copy its columns")

    def _index(self, name: str) -> int:
        for i, field in enumerate(self.fields):
            if field.name == name:
                return i
        names = ", ".join(field.name for field in self.fields)
        raise KeyError(f"no column {name!r}; the columns are: {names}")

    def _buffer(self, column: int, buffer: int, kind: Any, count: int) -> Any:
        child = self._array.children[column].contents
        address = child.buffers[buffer]
        view = (kind * count).from_address(address) if address else (kind * 0)()
        view.batch = self  # the memory is the batch's
        return view

    def column(self, name: str) -> memoryview:
        """A column of numbers, without a copy; of flags the bytes of their bits, see flags()."""
        i = self._index(name)
        form = self.fields[i].format
        if form == "b":
            return memoryview(self._buffer(i, 1, ctypes.c_uint8, (len(self) + 7) // 8)).cast("B")
        if form not in _ctypes_of:
            raise Invalid(errno.EINVAL, f"column {name} is text; take texts({name!r})")
        view = self._buffer(i, 1, _ctypes_of[form], len(self))
        return memoryview(view).cast("B").cast({"l": "q", "i": "i", "g": "d", "f": "f"}[form])

    def texts(self, name: str) -> List[str]:
        """A column of texts."""
        i = self._index(name)
        offsets = self._buffer(i, 1, ctypes.c_int32, len(self) + 1)
        data = bytes(self._buffer(i, 2, ctypes.c_char, offsets[len(self)]))
        known: Dict[bytes, str] = {}
        texts = []
        for k in range(len(self)):
            word = data[offsets[k] : offsets[k + 1]]
            text = known.get(word)
            if text is None:
                text = known[word] = _library.text(word)
            texts.append(text)
        return texts

    def flags(self, name: str) -> List[bool]:
        """A column of flags."""
        bits = self.column(name)
        return [bool(bits[i // 8] >> i % 8 & 1) for i in range(len(self))]

    def missing(self, name: str) -> Optional[memoryview]:
        """Bits of a column, 1 where a value is there; None where none is missing."""
        i = self._index(name)
        child = self._array.children[i].contents
        if not child.null_count:
            return None
        return memoryview(self._buffer(i, 0, ctypes.c_uint8, (len(self) + 7) // 8)).cast("B")

    def array(self, name: str) -> Any:
        """A column as an array; of numbers without a copy, unless a value is missing: NaN."""
        numpy = package("numpy", "an array")
        field = self.fields[self._index(name)]
        if field.format == "u":
            return numpy.array(self.texts(field.name), dtype=object)
        view = self.column(field.name)
        if field.format == "b":
            bits = numpy.unpackbits(numpy.frombuffer(view, "u1"), bitorder="little")
            return bits[: len(self)].astype(bool)
        values = numpy.frombuffer(view, _numpy_of[field.format])
        missing = self.missing(field.name)
        if missing is not None:
            there = numpy.unpackbits(numpy.frombuffer(missing, "u1"), bitorder="little")
            values = numpy.where(there[: len(self)].astype(bool), values, numpy.nan)
        return values

    def numpy(self) -> Dict[str, Any]:
        """All columns as arrays, see array()."""
        return {field.name: self.array(field.name) for field in self.fields}


# --- capsules ----------------------------------------------------------------------------

_library.prototypes(
    "libincise-record",
    """
    void incise_arrow_capsule_free(void *capsule);
    """,
)

_new = ctypes.pythonapi.PyCapsule_New
_new.restype = ctypes.py_object
_new.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
_name = ctypes.c_char_p(b"arrow_array_stream")  # for capsules to point at, for ever
ctypes.pythonapi.Py_IncRef(ctypes.py_object(_name))


def _capsule(open_stream: Callable[[ArrowArrayStream], None]) -> Any:
    # A consumer moves the stream out of this block, which the capsule's destructor frees.
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    libc.malloc.argtypes = [ctypes.c_size_t]
    destructor = ctypes.cast(function("incise_arrow_capsule_free"), ctypes.c_void_p)
    address = libc.malloc(ctypes.sizeof(ArrowArrayStream))
    if not address:
        raise MemoryError("no memory for a stream")
    stream = ArrowArrayStream.from_address(address)
    stream.release = type(stream.release)()
    try:
        open_stream(stream)
    except BaseException:
        libc.free.argtypes = [ctypes.c_void_p]
        libc.free(address)
        raise
    return _new(address, _name, destructor)


# --- tables -------------------------------------------------------------------------------


class Table(Tabular):
    """Rows that can be read again and again, each time in batches and with bounded memory.

    table["force_N"] is a column as an array, table[10:20] are rows, {column: array}, and
    table[["t_ns", "force_N"]] columns; len(table) counts the rows by reading them.
    """

    def __init__(self) -> None:
        raise TypeError("a Table comes of a recording: incise.open(path).pairs() and the like")

    @classmethod
    def _of(cls, open_stream: Any, about: str, part: Any, start_ns: Any) -> "Table":
        """open_stream fills in an ArrowArrayStream, part makes the same table of a part."""
        table = cls.__new__(cls)
        table._open, table._about, table._part = open_stream, about, part
        table._start_ns = start_ns
        table._schema = table._rows = None
        return table

    def __repr__(self) -> str:
        rows = "" if self._rows is None else f"{self._rows} rows of "
        try:
            return f"<incise.Table {self._about}: {rows}{', '.join(self.columns)}>"
        except Error as failure:
            return f"<incise.Table {self._about}: {failure}>"

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """A capsule of a new ArrowArrayStream (the Arrow PyCapsule interface)."""
        return _capsule(self._open)

    def _read_schema(self) -> Tuple[List[Field], Dict[str, str]]:
        if self._schema is None:
            self._schema = _Reader(self._open).schema()
        return self._schema

    @property
    def fields(self) -> List[Field]:
        """The columns with their units."""
        return self._read_schema()[0]

    @property
    def columns(self) -> List[str]:  # type: ignore[override]
        """The names of the columns."""
        return [field.name for field in self.fields]

    @property
    def metadata(self) -> Dict[str, str]:  # type: ignore[override]
        """The origin of the rows: sources, date, options, calibration."""
        return dict(self._read_schema()[1])

    def units(self) -> Dict[str, str]:
        """The unit of each column."""
        return {field.name: field.unit for field in self.fields}

    def between(self, from_s: float = 0, to_s: Optional[float] = None) -> "Table":
        """The rows from from_s to before to_s, seconds from the first force sample; None: to the end."""
        return self._part(between=(from_s, to_s))

    def cut(self, number: int) -> "Table":
        """The rows of a cut, from 1."""
        return self._part(cut=number)

    def __len__(self) -> int:
        if self._rows is None:
            self._rows = sum(len(batch) for batch in self.batches())
        return self._rows

    def __bool__(self) -> bool:
        return True  # a table; none of its rows is read for this

    def __iter__(self) -> Iterator[str]:
        """The names of the columns, as of {column: array}."""
        return iter(self.columns)

    @overload
    def __getitem__(self, key: str) -> "NDArray[Any]": ...

    @overload
    def __getitem__(self, key: Union[slice, List[str]]) -> Columns: ...

    @overload
    def __getitem__(self, key: int) -> Dict[str, Any]: ...

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return self._collect([key])[key]
        if isinstance(key, (list, tuple)):
            return Columns(self._collect(list(key)), self._about, self)
        if isinstance(key, slice):
            bounds = (key.start, key.stop, key.step)
            if any(n is not None and n < 0 for n in bounds):
                bounds = key.indices(len(self))
            start, stop, step = bounds
            if step is not None and step < 0:
                raise Invalid(errno.EINVAL, "rows are read forwards; give a step above 0")
            rows = self._collect(self.columns, start or 0, stop)
            return Columns({name: a[::step] for name, a in rows.items()}, self._about, self)
        try:
            at = operator.index(key)
        except TypeError:
            raise TypeError(
                f"{key!r}: a table takes a column's name, a list of names, rows [10:20] or a row"
            ) from None
        at += len(self) if at < 0 else 0
        row = self._collect(self.columns, at, at + 1)
        if at < 0 or not len(row[self.columns[0]]):
            raise IndexError(f"row {key}: there are {len(self)} rows")
        return {name: values[0] for name, values in row.items()}

    def batches(self) -> Iterator[Batch]:
        """The rows, some ten thousand at a time; needs no other package."""
        reader = _Reader(self._open)
        fields, _ = reader.schema()
        array = reader.next()
        while array is not None:
            yield Batch._of(array, fields)
            array = reader.next()
        reader.close()

    def _collect(
        self, names: List[str], start: int = 0, stop: Optional[int] = None
    ) -> Dict[str, Any]:
        """Columns as arrays, of the rows from start to before stop."""
        numpy = package("numpy", "an array")
        kinds = {**_numpy_of, "b": "?", "u": "O"}
        forms = {field.name: kinds[field.format] for field in self.fields}
        for name in names:
            if name not in forms:
                raise KeyError(f"no column {name!r}; the columns are: {', '.join(forms)}")
        parts: Dict[str, List[Any]] = {name: [numpy.empty(0, forms[name])] for name in names}
        at = 0
        for batch in self.batches():
            if stop is not None and at >= stop:
                break
            rows = slice(max(start - at, 0), None if stop is None else stop - at)
            for name in names:
                parts[name].append(batch.array(name)[rows])
            at += len(batch)
        return {name: numpy.concatenate(parts.pop(name)) for name in names}

    def numpy(self) -> Dict[str, Any]:
        """All rows as arrays, {column: array}. A missing value is NaN."""
        return self._collect(self.columns)

    def _head(self) -> Tuple[Dict[str, Any], str]:
        rows = "first rows" if self._rows is None else f"first of {self._rows} rows"
        return self[:8], f"{self._about}, {rows}"

    def parquet(self, path: PathLike, *, overwrite: bool = False) -> None:
        """Write all rows to a Parquet file, with units and provenance, in bounded memory; needs pyarrow.

        The file appears when it is complete."""
        name = os.fsdecode(_library.new_path(path, ".parquet", overwrite))
        pyarrow = package("pyarrow", "Parquet")
        parquet = package("pyarrow.parquet", "Parquet")
        part = name + ".part"
        try:
            reader = pyarrow.RecordBatchReader.from_stream(self)
            batches = iter(reader)
            with parquet.ParquetWriter(part, reader.schema) as writer:
                for group in iter(lambda: list(itertools.islice(batches, 64)), []):
                    writer.write_table(pyarrow.Table.from_batches(group))
            os.replace(part, name)
        finally:
            if os.path.exists(part):
                os.remove(part)
