# SPDX-License-Identifier: LGPL-2.1-or-later
"""Columns of Python as an ArrowArrayStream, for the C library to read: one batch, copied once."""

import array
import ctypes
import errno

from ._library import ArrowArray, ArrowArrayStream, ArrowSchema, Invalid

_capsule_pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


def _released(pointer):
    """Mark a struct as released; its memory is the stream's."""
    struct = pointer.contents
    place = type(struct).release
    ctypes.memset(ctypes.addressof(struct) + place.offset, 0, place.size)


class ColumnStream:
    """A stream over {name: values}. Keep it until the stream is released."""

    def __init__(self, columns):
        self._buffers = []
        self._given = False
        lengths = {len(values) for values in columns.values()}
        if len(lengths) != 1:
            raise Invalid(
                errno.EINVAL,
                "columns of different lengths: "
                + ", ".join(f"{name} {len(values)}" for name, values in columns.items()),
            )
        self._rows = lengths.pop()
        n = len(columns)
        self._schemas = (ArrowSchema * n)()
        self._arrays = (ArrowArray * n)()
        for i, (name, values) in enumerate(columns.items()):
            self._column(i, str(name), values)
        self._schema_list = (ctypes.POINTER(ArrowSchema) * n)(
            *(ctypes.pointer(schema) for schema in self._schemas)
        )
        self._array_list = (ctypes.POINTER(ArrowArray) * n)(
            *(ctypes.pointer(column) for column in self._arrays)
        )
        self._none = (ctypes.c_void_p * 1)()
        kind = ArrowArrayStream
        self.stream = kind(
            dict(kind._fields_)["get_schema"](self._get_schema),
            dict(kind._fields_)["get_next"](self._get_next),
            dict(kind._fields_)["get_last_error"](lambda stream: None),
            dict(kind._fields_)["release"](_released),
        )
        self._release_schema = dict(ArrowSchema._fields_)["release"](_released)
        self._release_array = dict(ArrowArray._fields_)["release"](_released)

    def _keep(self, *buffers):
        kept = (ctypes.c_void_p * len(buffers))()
        for i, buffer in enumerate(buffers):
            if buffer is None:
                continue
            view = (ctypes.c_char * len(buffer)).from_buffer_copy(buffer)
            self._buffers.append(view)
            kept[i] = ctypes.addressof(view)
        self._buffers.append(kept)
        return kept

    def _column(self, i, name, values):
        if hasattr(values, "tolist") and getattr(values, "dtype", None) is not None:
            numbers = values.dtype.kind in "biuf"
        else:
            numbers = all(isinstance(value, (int, float)) for value in values)
        if numbers:
            try:
                data = array.array("d", values)
            except (TypeError, OverflowError) as failure:
                raise Invalid(errno.EINVAL, f"column {name}: {failure}") from None
            form, buffers = b"g", self._keep(None, memoryview(data).cast("B"))
        else:
            words = [str(value).encode() for value in values]
            offsets = array.array("q", [0])
            for word in words:
                offsets.append(offsets[-1] + len(word))
            form = b"U"
            buffers = self._keep(None, memoryview(offsets).cast("B"), b"".join(words) or b"\0")
        self._schemas[i].format = form
        self._schemas[i].name = name.encode()
        self._arrays[i].length = self._rows
        self._arrays[i].n_buffers = len(buffers)
        self._arrays[i].buffers = ctypes.cast(buffers, ctypes.POINTER(ctypes.c_void_p))

    def _get_schema(self, stream, out):
        schema = out.contents
        ctypes.memset(ctypes.addressof(schema), 0, ctypes.sizeof(schema))
        schema.format = b"+s"
        schema.n_children = len(self._schemas)
        schema.children = ctypes.cast(
            self._schema_list, ctypes.POINTER(ctypes.POINTER(ArrowSchema))
        )
        schema.release = self._release_schema
        return 0

    def _get_next(self, stream, out):
        batch = out.contents
        ctypes.memset(ctypes.addressof(batch), 0, ctypes.sizeof(batch))
        if self._given:
            return 0
        self._given = True
        batch.length = self._rows
        batch.n_buffers = 1
        batch.buffers = ctypes.cast(self._none, ctypes.POINTER(ctypes.c_void_p))
        batch.n_children = len(self._arrays)
        batch.children = ctypes.cast(self._array_list, ctypes.POINTER(ctypes.POINTER(ArrowArray)))
        batch.release = self._release_array
        return 0


def column_names(table):
    """The names of the columns of a DataFrame, table, structured array or {column: values}, or None."""
    found = getattr(getattr(table, "dtype", None), "names", None)
    for attribute in ("column_names", "columns"):
        found = getattr(table, attribute, None) if found is None else found
    if found is None and hasattr(table, "keys"):
        found = table.keys()
    if found is None or not any(isinstance(name, str) for name in found):
        return None
    return list(found)


def open_stream(table):
    """A stream of a table in any form: (stream, an object to keep until it is released).

    Anything with __arrow_c_stream__, or {column: values}, as a dict or a DataFrame.
    """
    if hasattr(table, "__arrow_c_stream__") and not hasattr(table, "to_dict"):
        capsule = table.__arrow_c_stream__()
        address = _capsule_pointer(capsule, b"arrow_array_stream")
        return ArrowArrayStream.from_address(address), capsule
    names = column_names(table)
    if names is None and not hasattr(table, "keys"):
        raise Invalid(
            errno.EINVAL,
            f"a {type(table).__name__} is no table; give a path, a DataFrame, {{column: values}}, "
            "anything with __arrow_c_stream__, or inputs and output: train(X, y)",
        )
    columns = {str(name): table[name] for name in names or ()}
    made = ColumnStream(
        {name: v.to_numpy() if hasattr(v, "to_numpy") else v for name, v in columns.items()}
    )
    return made.stream, made
