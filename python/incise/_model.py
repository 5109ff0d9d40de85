# SPDX-License-Identifier: LGPL-2.1-or-later
"""Fuzzy force models: evaluated, saved, compiled to fixed point, and learnt from data."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import math
import os
import pathlib
import tempfile
import warnings
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence
from typing import TYPE_CHECKING, Tuple, Union, overload

from . import _library
from ._library import Invalid, PathLike, c_double, c_int, c_void_p, call, function, package
from ._library import text, values
from ._producer import column_names, open_stream
from ._recording import Recording
from ._show import html_table, plot_model

if TYPE_CHECKING:
    from typing import Literal

    from numpy.typing import NDArray

    Point = Union[Tuple[float, ...], List[float], Dict[str, float]]
    Array = NDArray[Any]
    Yes = Literal[True]
    No = Literal[False]

INPUTS_MAX, RULES_MAX, NAME_MAX = 8, 256, 64
_doubles = ctypes.POINTER(c_double)

FIXED_ONE = 1 << 16  # 1.0 in a compiled model


VariableStruct, ModelInfoStruct, PairsStruct, SideStruct, StepStruct = _library.structs("""
    struct incise_variable {
        char name[64];
        double min, max;
    };
    struct incise_model_info {
        char name[64];
        int n_inputs, n_rules, and_method;
        struct incise_variable input[8], output;
        int n_mfs[8];
    };
    struct incise_pairs {
        double *rows;
        uint64_t n;
        int n_inputs;
        const double *weights;
    };
    struct incise_train_side {
        struct incise_pairs pairs;
        int *groups, n_groups;
    };
    struct incise_train_step {
        int phase, epoch;
        double train_rmse, check_rmse;
        int source, sources, resumed;
        uint64_t rows, total;
    };
    """)


_Progress = ctypes.CFUNCTYPE(c_int, c_void_p, ctypes.POINTER(StepStruct))


TrainOptionsStruct, TrainReportStruct = _library.structs(
    """
    struct incise_train_options {
        int epochs;
        double step, ridge;
        bool classic;
        int *groups;
        uint64_t seed;
        _Progress progress;
        void *user;
        size_t tuned;
        void **uncertainty;
        struct incise_variable *ranges;
    };
    struct incise_train_report {
        int epochs, best_epoch;
        double ridge, train_rmse, check_rmse, condition;
        int parameters, rules_unfired;
        double train_r2, check_r2, crossval_rmse, crossval_plane, crossval_mean,
            crossval_quadratic;
        size_t pairs_tuned;
        bool unfired[256];
    };
    """,
    _Progress=_Progress,
)


PHASES = ("survey", "search", "add", "solve")


class TrainStep(NamedTuple):
    """A step of a training, for the progress of :func:`incise.train`."""

    phase: str  #: survey, search, add or solve
    epoch: int  #: of the final training, that has ended; 0: none
    train_rms_error: float  #: after that epoch
    check_rms_error: float
    rows: int  #: read of the sources
    total: int  #: to be read; 0: not known


class Stop:
    """The progress of a training, by which another thread or the caller's function ends it."""

    def __init__(
        self, options: TrainOptionsStruct, progress: Optional[Callable[[TrainStep], object]] = None
    ):
        self.set = False
        self.failure: Optional[BaseException] = None  # of the caller's function
        self.progress = progress
        options.progress = _Progress(self._step)

    def _step(self, _user: Any, step: Any) -> bool:
        if self.progress and not self.set:
            s = step.contents
            try:
                self.progress(
                    TrainStep(PHASES[s.phase], s.epoch, s.train_rmse, s.check_rmse, s.rows, s.total)
                )
            except BaseException as failure:  # raised again in the caller
                self.failure, self.set = failure, True
        return self.set

    def cancel(self) -> None:
        self.set = True

    def run(self, learn: Callable[[], Model]) -> Model:
        """Learn in a thread, which Ctrl-C ends."""
        try:
            return _library.call_interruptible(learn, self.cancel)
        except _library.Error:
            if self.failure:
                raise self.failure from None
            raise


BaselinesStruct, FixedOptionsStruct, FixedInputStruct, FixedStruct = _library.structs("""
    struct incise_baselines {
        double mean, linear, knn;
        int k;
    };
    struct incise_fixed_options {
        double budget;
        int arithmetic, cells;
    };
    struct incise_fixed_input {
        const char *name;
        int min, max, n_mfs, cell_shift, cells, *values;
    };
    struct incise_fixed {
        int arithmetic, n_inputs, n_rules, shift_a, shift_b;
        uint64_t bound;
        struct incise_fixed_input input[4];
        const char *name, *output;
        void *data, *blob;
        uint32_t size;
    };
    """)


_path = ctypes.c_char_p
_library.prototypes(
    "libincise",
    """
    struct incise_model *incise_model_load(const char *path, struct incise_error *err);
    int incise_model_save_notes(const struct incise_model *model, const char *path,
        const char *notes, struct incise_error *err);
    void incise_model_free(struct incise_model *model);
    const struct incise_model_info *incise_model_info(const struct incise_model *model);
    void incise_model_set_clamp(struct incise_model *model, bool clamp);
    int incise_inputs_check(const struct incise_variable *inputs, int n_inputs, const double *x,
        uint64_t n, uint64_t *outside, struct incise_error *err);
    void incise_model_eval_many(const struct incise_model *model, const double *x, size_t n,
        double *y, double *gradient);
    struct incise_uncertainty *incise_uncertainty_load(const char *path,
        const struct incise_model *model, struct incise_error *err);
    int incise_uncertainty_save(const struct incise_uncertainty *uncertainty, const char *path,
        struct incise_error *err);
    void incise_uncertainty_free(struct incise_uncertainty *uncertainty);
    double incise_uncertainty_noise(const struct incise_uncertainty *uncertainty);
    void incise_uncertainty_sd_many(const struct incise_uncertainty *uncertainty,
        const struct incise_model *model, const double *x, size_t n, double *sd);
    void incise_uncertainty_parts_many(const struct incise_uncertainty *uncertainty,
        const struct incise_model *model, const double *x, size_t n,
        struct incise_uncertainty_parts *parts);
    struct incise_fixed *incise_fixed_compile(const struct incise_model *model,
        const struct incise_fixed_options *options, struct incise_error *err);
    struct incise_fixed *incise_fixed_load(const char *path, struct incise_error *err);
    int incise_fixed_save(const struct incise_fixed *fx, const char *path,
        struct incise_error *err);
    void incise_fixed_free(struct incise_fixed *fx);
    double incise_fixed_bound(const struct incise_fixed *fx);
    const char *incise_fixed_arithmetic_name(enum incise_fixed_arithmetic arithmetic);
    void incise_fixed_options_init(struct incise_fixed_options *options);
    double incise_fixed_eval_double(const struct incise_fixed *fx, const double *x);
    void incise_fixed_eval_batch(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
        uint64_t n);
    """,
)
_names = ctypes.POINTER(ctypes.c_char_p)
_library.prototypes(
    "libincise-learn",
    """
    struct incise_dataset *incise_dataset_read_where(const char *path, const char *const *columns,
        int n, const char *group, const char *where, size_t *left_out, struct incise_error *err);
    struct incise_dataset *incise_dataset_from_arrow(struct ArrowArrayStream *stream,
        const char *const *columns, int n, const char *group, const char *where, size_t *left_out,
        struct incise_error *err);
    bool incise_dataset_has(const char *path, const char *column, bool *stated);
    void incise_dataset_free(struct incise_dataset *data);
    size_t incise_dataset_rows(const struct incise_dataset *data);
    void incise_train_options_init(struct incise_train_options *options);
    int incise_train_split(const struct incise_dataset *data, double share, uint64_t seed,
        struct incise_train_side *fit, struct incise_train_side *check, struct incise_error *err);
    void incise_train_side_free(struct incise_train_side *side);
    struct incise_model *incise_train_start(const struct incise_pairs *pairs,
        const char *const *names, enum incise_mf_type type, int *n_mfs,
        const struct incise_train_options *options, struct incise_error *err);
    int incise_train(struct incise_model *model, const struct incise_pairs *train,
        const struct incise_pairs *check, const struct incise_train_options *options,
        struct incise_train_report *report, struct incise_error *err);
    int incise_baselines(const struct incise_pairs *train, const int *groups,
        const struct incise_pairs *on, incise_train_progress progress, void *user,
        struct incise_baselines *result, struct incise_error *err);
    """,
)


class Variable(NamedTuple):
    """An input or the output of a model, with the range that it was trained on."""

    name: str
    min: float
    max: float


class Points:
    """Inputs of a model as one block of doubles, in the form that they came in.

    Columns of tables go by their names. Values have to be finite; a warning counts the points
    outside the ranges.
    """

    def __init__(self, x: Any, inputs: Any):
        """inputs: structs of the variables, in the order of the model."""
        n_inputs = len(inputs)
        columns = self._by_name(x, [text(variable.name) for variable in inputs])
        if columns is not None:
            x = self._join(columns)
        self.array = self._of_numpy(x)
        if self.array is not None:
            self._check_shape(self.array.shape, n_inputs)
            self.shape = self.array.shape[:-1]
            self.n = math.prod(self.shape)
            self.address = self.array.ctypes.data
        else:
            rows, self.shape = self._of_lists(x, n_inputs)
            self.n = len(rows) // n_inputs
            self._block = (c_double * max(len(rows), 1))(*rows)
            self.address = ctypes.addressof(self._block)
        self._check(inputs)

    def _check(self, inputs: Any) -> None:
        outside = ctypes.c_size_t()
        call(
            "incise_inputs_check",
            (VariableStruct * len(inputs))(*inputs),
            len(inputs),
            self.address,
            self.n,
            ctypes.byref(outside),
        )
        if outside.value:
            ranges = ", ".join(f"{text(v.name)} {v.min:.4g} to {v.max:.4g}" for v in inputs)
            warnings.warn(
                f"{outside.value} of {self.n} points are outside the training range ({ranges}) and "
                "are clamped to it",
                stacklevel=4,
            )

    @staticmethod
    def _by_name(x: Any, names: List[str]) -> Optional[List[Any]]:
        """The columns of a table, {column: values} or structured array; None: it is none."""
        found = column_names(x)
        if found is None:
            return None
        missing = [name for name in names if name not in found]
        if missing:
            raise Invalid(
                errno.EINVAL,
                f"inputs have no column {', '.join(missing)}; the columns are "
                f"{', '.join(map(str, found))}",
            )
        return [x[name] for name in names]

    @classmethod
    def _join(cls, columns: List[Any]) -> Any:
        """One array, or rows without numpy."""
        arrays = [cls._of_numpy(column) for column in columns]
        if all(array is not None for array in arrays):
            import numpy

            try:
                return numpy.stack(arrays, axis=-1)
            except ValueError as failure:
                raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None
        if not all(hasattr(column, "__len__") for column in columns):
            return columns
        if len({len(column) for column in columns}) > 1:
            raise Invalid(errno.EINVAL, "inputs of a model: columns of different lengths")
        return list(zip(*columns))

    @staticmethod
    def _of_numpy(x: Any) -> Any:
        """An array of doubles, or None for plain lists and numbers without numpy."""
        import sys

        numpy = sys.modules.get("numpy")
        if numpy is None:
            if not hasattr(x, "__array__"):
                return None
            import numpy
        elif isinstance(x, (tuple, list)) and x and isinstance(x[0], (int, float)):
            return None
        try:
            if numpy.iscomplexobj(x):
                raise TypeError("complex numbers")
            if numpy.ma.isMaskedArray(x):
                x = x.astype(numpy.float64).filled(math.nan)
            return numpy.ascontiguousarray(x, dtype=numpy.float64).reshape(numpy.shape(x))
        except (TypeError, ValueError) as failure:
            raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None

    @staticmethod
    def _check_shape(shape: Tuple[int, ...], n_inputs: int) -> None:
        if not shape or shape[-1] != n_inputs:
            raise Invalid(
                errno.EINVAL,
                f"inputs have the shape {tuple(shape)}; the model has {n_inputs} inputs, so the "
                f"last length must be {n_inputs}",
            )

    @classmethod
    def _of_lists(cls, x: Any, n_inputs: int) -> Tuple[List[float], Optional[Tuple[int, ...]]]:
        try:
            single = not x or isinstance(x[0], (int, float))
            rows = [x] if single else list(x)
            numbers = [float(value) for row in rows for value in row]
        except (TypeError, ValueError, KeyError) as failure:
            raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None
        for row in rows:
            cls._check_shape((len(row),), n_inputs)
        return numbers, None if single else (len(rows),)

    def results(self, width: int = 1) -> Tuple[Any, int]:
        """Room for width results a point: (block, its address)."""
        if self.array is not None:
            import numpy

            shape = self.shape + ((width,) if width > 1 else ())
            block = numpy.empty(shape, dtype=numpy.float64)
            return block, block.ctypes.data
        block = (c_double * max(self.n * width, 1))()
        return block, ctypes.addressof(block)

    def finish(self, block: Any, width: int = 1) -> Any:
        """Results in the form of the inputs: an array, a list, or for one point a number."""
        if self.array is not None:
            return block if block.shape else float(block)
        values: List[Any] = list(block[: self.n * width])
        if width > 1:
            values = [values[i : i + width] for i in range(0, len(values), width)]
        return values if self.shape is not None else values[0]


class CompiledModel:
    """The model of a .fx file: in fixed point, with a certified bound of its error."""

    def __init__(self, path: PathLike):
        name = _library.path_bytes(path)
        self._own(call("incise_fixed_load", name))

    def _own(self, pointer: Any) -> None:
        self._pointer = _library.Handle(pointer, "incise_fixed_free")
        self._struct = pointer.contents
        self._inputs = [
            VariableStruct(v.name, v.min / FIXED_ONE, v.max / FIXED_ONE)
            for v in self._struct.input[: self._struct.n_inputs]
        ]

    @classmethod
    def _of(cls, pointer: Any) -> "CompiledModel":
        """The compiled model of a pointer, which it frees."""
        compiled = cls.__new__(cls)
        compiled._own(pointer)
        return compiled

    def __reduce__(self) -> Any:
        return _compiled_of_bytes, (ctypes.string_at(self._struct.blob, self._struct.size),)

    @property
    def bound(self) -> float:
        """Certified largest error, in the output's unit."""
        return function("incise_fixed_bound")(self._pointer)

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self._struct.size

    @property
    def arithmetic(self) -> str:
        """direct, table or force."""
        return text(function("incise_fixed_arithmetic_name")(self._struct.arithmetic))

    @overload
    def __call__(self, x: Point) -> float: ...
    @overload
    def __call__(self, x: Any) -> Array: ...

    def __call__(self, x: Any) -> Any:
        """The output at one point, or at each point of an array (…, inputs)."""
        points = Points(x, self._inputs)
        block, address = points.results()
        one = function("incise_fixed_eval_double")
        step = 8 * self._struct.n_inputs
        out = (c_double * points.n).from_address(address) if points.n else []
        for k in range(points.n):
            out[k] = one(self._pointer, points.address + k * step)
        return points.finish(block)

    def __repr__(self) -> str:
        names = ", ".join(text(v.name) for v in self._inputs)
        return (
            f"<incise.CompiledModel {text(self._struct.output)} of {names}: {self.arithmetic}, "
            f"{self.size} bytes, error at most {self.bound:.3g}>"
        )

    def save(self, path: PathLike, *, overwrite: bool = False) -> None:
        """Write the .fx file, whole or not at all."""
        call("incise_fixed_save", self._pointer, _library.new_path(path, ".fx", overwrite))


class TrainReport(NamedTuple):
    """Report of :func:`incise.train`; errors in the output's unit, NaN without data."""

    pairs: int  #: trained from
    check_pairs: int  #: kept back
    left_out: int  #: rows where the blade did not advance
    epochs: int
    ridge: float
    train_rms_error: float
    check_rms_error: float
    crossval_rms_error: float
    condition: float
    parameters: int
    rules_unfired: int
    train_r2: float
    check_r2: float
    baselines: Dict[str, float]  #: rms error of mean, linear, knn on the pairs kept back


class Model:
    """The fuzzy model of a .fis file, with its standard deviation if PATH.sd is there: call it with
    inputs in the order of :attr:`inputs`, or with a table, {column: values} or structured array that
    has columns of their names.

    model((5, 20)) is one force; model(x) of an array (…, inputs) an array; with sd=True a pair of
    these, the output and its standard deviation for a new cut. A value that is not finite or is masked
    is an error; points outside the ranges are clamped to them, with a warning, and their sd is nan.
    """

    def __init__(self, path: PathLike):
        name = _library.path_bytes(path)
        self._own(call("incise_model_load", name))
        if os.path.exists(name + b".sd"):
            self._set_uncertainty(call("incise_uncertainty_load", name + b".sd", self._pointer))

    def _own(self, pointer: int) -> None:
        self._pointer = _library.Handle(pointer, "incise_model_free")
        self._set_uncertainty(None)
        self._report: Optional[TrainReport] = None
        self._notes = b""  # of a training from many sources: version, options and sources

    @classmethod
    def _of(cls, pointer: int) -> "Model":
        """The model of a pointer, which it frees."""
        model = cls.__new__(cls)
        model._own(pointer)
        return model

    def _set_uncertainty(self, pointer: Optional[int]) -> None:
        self._uncertainty = pointer and _library.Handle(pointer, "incise_uncertainty_free")

    def __reduce__(self) -> Any:
        """Copies and pickles are the files, whose numbers are exact."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "model.fis")
            self.save(path)
            files = (pathlib.Path(path), pathlib.Path(path + ".sd"))
            texts = [file.read_bytes() if file.exists() else None for file in files]
        return _model_of_bytes, (*texts, self._report, self._notes)

    def __repr__(self) -> str:
        inputs = ", ".join(variable.name for variable in self.inputs)
        return f"<incise.Model {self.output.name} of {inputs}, {self.n_rules} rules>"

    def _inputs(self) -> Any:
        return self._info().input[: self._info().n_inputs]

    def _info(self) -> ModelInfoStruct:
        return function("incise_model_info")(self._pointer).contents

    @property
    def inputs(self) -> Tuple[Variable, ...]:
        """Inputs, with their ranges."""
        info = self._info()
        return tuple(Variable(text(v.name), v.min, v.max) for v in info.input[: info.n_inputs])

    @property
    def output(self) -> Variable:
        """The output, with the range that it was trained on."""
        v = self._info().output
        return Variable(text(v.name), v.min, v.max)

    @property
    def n_rules(self) -> int:
        """Rules."""
        return self._info().n_rules

    @property
    def report(self) -> TrainReport:
        """Report of the training that made it."""
        if self._report is None:
            raise Invalid(errno.EINVAL, "the model is of a file; a report comes of incise.train()")
        return self._report

    @property
    def noise(self) -> float:
        """Noise of new cuts, its root mean square over the training; NaN without a .sd file."""
        if not self._uncertainty:
            return math.nan
        return function("incise_uncertainty_noise")(self._uncertainty)

    @overload
    def __call__(self, x: Point, *, sd: No = ..., parts: No = ...) -> float: ...
    @overload
    def __call__(self, x: Point, *, sd: Yes, parts: No = ...) -> Tuple[float, float]: ...
    @overload
    def __call__(self, x: Any, *, sd: No = ..., parts: No = ...) -> Array: ...
    @overload
    def __call__(self, x: Any, *, sd: Yes, parts: No = ...) -> Tuple[Array, Array]: ...
    @overload
    def __call__(self, x: Any, *, sd: Yes, parts: Yes) -> Tuple[Any, Any, Any]: ...
    @overload
    def __call__(self, x: Any, *, sd: bool, parts: bool = ...) -> Any: ...

    def __call__(self, x: Any, *, sd: bool = False, parts: bool = False) -> Any:
        """The output; with sd=True (output, standard deviation).

        With parts=True too (output, standard deviation, parts): in the last dimension of the parts
        data, model, calibration and rig, whose squares add up to that of the standard deviation, and
        mean, that of the mean of all cuts, NaN where it is not known.
        """
        if parts and not sd:
            raise Invalid(errno.EINVAL, "parts are those of the standard deviation; give sd=True")
        points = Points(x, self._inputs())
        block, address = points.results()
        function("incise_model_eval_many")(self._pointer, points.address, points.n, address, None)
        if not sd:
            return points.finish(block)
        if not self._uncertainty:
            raise Invalid(
                errno.EINVAL,
                "the model has no standard deviation; train it here, or load a .fis that has its "
                ".fis.sd beside it",
            )
        spread, spread_address = points.results()
        function("incise_uncertainty_sd_many")(
            self._uncertainty, self._pointer, points.address, points.n, spread_address
        )
        if not parts:
            return points.finish(block), points.finish(spread)
        # struct incise_uncertainty_parts: the total, four parts, and the mean
        whole, whole_address = points.results(6)
        function("incise_uncertainty_parts_many")(
            self._uncertainty, self._pointer, points.address, points.n, whole_address
        )
        each = points.finish(whole, 6)
        if points.array is not None:
            each = each[..., 1:]
        elif points.shape is None:
            each = each[1:]
        else:
            each = [row[1:] for row in each]
        return points.finish(block), points.finish(spread), each

    def gradient(self, x: Any) -> Any:
        """Slopes of the output by each input, in the last dimension; 0 outside the ranges."""
        n_inputs = self._info().n_inputs
        points = Points(x, self._inputs())
        _, address = values = points.results()
        block, gradient_address = points.results(n_inputs)
        function("incise_model_eval_many")(
            self._pointer, points.address, points.n, address, gradient_address
        )
        del values
        return points.finish(block, n_inputs)

    def save(self, path: PathLike, *, overwrite: bool = False) -> None:
        """Write the .fis file, and its standard deviation as PATH.sd; each whole or not at all.

        A model trained from a list of sources notes version, options and sources, as the tool does.
        """
        name = _library.new_path(path, ".fis", overwrite)
        _library.new_path(name + b".sd", ".sd", overwrite)
        call("incise_model_save_notes", self._pointer, name, self._notes)
        if self._uncertainty:
            call("incise_uncertainty_save", self._uncertainty, name + b".sd")
        elif os.path.exists(name + b".sd"):
            os.remove(name + b".sd")  # of the model that was overwritten

    def plot(self, data: Any = None, *, ax: Any = None) -> Any:
        """Plot the output over the first input, at three values of the second, with the 95 % interval
        of new cuts; below the residuals of data, a table. Returns the matplotlib axes."""
        return plot_model(self, data, ax)

    def _repr_html_(self) -> str:
        rows = [(v.name, v.min, v.max) for v in (*self.inputs, self.output)]
        return html_table(repr(self)[1:-1], ("variable", "from", "to"), rows)

    def compile(self, *, budget_mN: float = 0.1) -> CompiledModel:
        """Compile to fixed point; the certified error is at most budget_mN (0: any)."""
        options = FixedOptionsStruct()
        function("incise_fixed_options_init")(options)
        options.budget = budget_mN * 1e-3
        return CompiledModel._of(call("incise_fixed_compile", self._pointer, options))


def _model_of_bytes(
    fis: bytes, sd: Optional[bytes], report: Optional[TrainReport], notes: bytes = b""
) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "model.fis")
        path.write_bytes(fis)
        if sd is not None:
            path.with_suffix(".fis.sd").write_bytes(sd)
        model = Model(path)
    model._report, model._notes = report, notes
    return model


def _compiled_of_bytes(blob: bytes) -> CompiledModel:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "model.fx")
        path.write_bytes(blob)
        return CompiledModel(path)


@contextlib.contextmanager
def model_file(model: Union[PathLike, Model, CompiledModel]) -> Iterator[bytes]:
    """The path of a model's file; of a model in memory a file for the time being."""
    if is_path(model):
        yield _library.path_bytes(model)
        return
    if not isinstance(model, (Model, CompiledModel)):
        raise Invalid(
            errno.EINVAL, f"model: expected a path or a model, found a {type(model).__name__}"
        )
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "model.fis" if isinstance(model, Model) else "model.fx")
        model.save(path)
        yield _library.path_bytes(path)


def name_array(names: Sequence[str]) -> Any:
    return (ctypes.c_char_p * len(names))(*(name.encode() for name in names))


def is_path(data: Any) -> bool:
    return isinstance(data, (str, bytes, os.PathLike))


def is_recording(data: Any) -> bool:
    """Whether it is a path with the name of a recording."""
    return is_path(data) and _library.path_bytes(data).rstrip(b"/").endswith((b".rec", b".part"))


def has_cuts(data: Any) -> bool:
    """Whether it is a recording, or a file or a table with the column cut."""
    if isinstance(data, Recording) or is_recording(data):
        return True
    if not is_path(data):
        return "cut" in (column_names(data) or ())
    path = _library.path_bytes(data)
    return os.path.isfile(path) and function("incise_dataset_has")(path, b"cut", None)


def _read_dataset(
    data: Any, columns: Sequence[str], group: Optional[str], where: Optional[str]
) -> Tuple[int, int]:
    """A dataset of a path or a table, and how many rows were left out."""
    left_out = ctypes.c_size_t()
    rest = (
        name_array(columns),
        len(columns),
        group.encode() if group else None,
        where.encode() if where else None,
        ctypes.byref(left_out),
    )
    if isinstance(data, Recording):
        data = data.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
    if is_recording(data):
        return _read_dataset(Recording(os.fsdecode(data)), columns, group, where)
    if is_path(data):
        dataset = call("incise_dataset_read_where", _library.path_bytes(data), *rest)
    else:
        stream, keep = open_stream(data)
        dataset = call("incise_dataset_from_arrow", stream, *rest)
        del keep
    return dataset, left_out.value


def start(
    pairs: PairsStruct, names: Sequence[str], mf_type: int, mf: Any, options: TrainOptionsStruct
) -> int:
    """The model that a training starts from."""
    return call("incise_train_start", pairs, name_array(names), mf_type, mf, options)


def baselines(fit: SideStruct, check: SideStruct, progress: Any) -> BaselinesStruct:
    """Errors of simpler predictors on the pairs kept back."""
    result = BaselinesStruct()
    call("incise_baselines", fit.pairs, fit.groups, check.pairs, progress, None, result)
    return result


_BASELINES = ("mean", "linear", "knn")


def report_of(
    report: TrainReportStruct,
    pairs: int,
    check_pairs: int,
    left_out: int,
    others: Optional[BaselinesStruct],
) -> TrainReport:
    names = [name.replace("rms_error", "rmse") for name in TrainReport._fields[3:-1]]
    errors = {} if others is None else {name: getattr(others, name) for name in _BASELINES}
    return TrainReport(pairs, check_pairs, left_out, *values(report, names), errors)


class _Training:
    """One training; frees what it holds."""

    def __init__(self, dataset: int, share: float, options: TrainOptionsStruct):
        self.dataset, self.options = dataset, options
        self.fit, self.check = SideStruct(), SideStruct()
        self.has_check = share != 0
        call("incise_train_split", dataset, share, options.seed, self.fit, self.check)
        options.groups = self.fit.groups

    def close(self) -> None:
        function("incise_train_side_free")(self.fit)
        if self.has_check:
            function("incise_train_side_free")(self.check)
        function("incise_dataset_free")(self.dataset)

    def run(self, model: Model) -> TrainReportStruct:
        report, uncertainty = TrainReportStruct(), c_void_p()
        self.options.uncertainty = ctypes.pointer(uncertainty)
        call(
            "incise_train",
            model._pointer,
            self.fit.pairs,
            self.check.pairs if self.has_check else None,
            self.options,
            report,
        )
        model._set_uncertainty(uncertainty.value)
        return report


_mf_types = {"gaussmf": 0, "gbellmf": 1}


def _mf_counts(mf: Union[str, Sequence[int], None], n_inputs: int) -> Any:
    if mf is None:
        mf = (5, 4) if n_inputs == 2 else (3,) * n_inputs
    if isinstance(mf, str):
        if mf != "auto":
            raise Invalid(errno.EINVAL, f"mf={mf!r}: give 'auto', or a count for each input")
        mf = (0,) * n_inputs
    elif len(mf) != n_inputs or not all(1 <= int(n) <= 32 for n in mf):
        raise Invalid(
            errno.EINVAL,
            f"mf={tuple(mf)!r}: give a count from 1 to 32 for each of {n_inputs} inputs",
        )
    return (c_int * INPUTS_MAX)(*(int(n) for n in mf))


_INPUTS, _TARGET = ("depth_mm", "velocity_mm_s"), "force_N"


def _table_of(
    x: Any, y: Any, inputs: Optional[Sequence[str]], target: Optional[str], group: Any
) -> Tuple[Dict[str, Any], Sequence[str], str, Optional[str]]:
    """{column: array} of inputs, output and group, and their names."""
    numpy = package("numpy", "train(X, y)")
    names = column_names(x)
    if group is None and names and "cut" in names:
        group = "cut"
    column = group if isinstance(group, str) else None
    if names and inputs is None:
        inputs = [str(name) for name in names if name != column]
    try:
        if not names:
            x = numpy.asarray(x, numpy.float64)
            inputs = inputs or (_INPUTS if x.shape[1:] == (2,) else None)
            if inputs is None or x.ndim != 2 or x.shape[1] != len(inputs):
                raise ValueError(f"X has the shape {x.shape}; name its columns by inputs=(…)")
            x = {name: x[:, i] for i, name in enumerate(inputs)}
        name = getattr(y, "name", None)
        target = target or (name if isinstance(name, str) else _TARGET)
        table = {name: numpy.asarray(x[name], numpy.float64) for name in inputs}
        table[target] = numpy.asarray(y, numpy.float64).reshape(-1)
        if group is not None and column != "none":
            table["group"] = numpy.asarray(x[column] if column else group)
            group = "group"
    except KeyError as missing:
        raise Invalid(errno.EINVAL, f"train(X, y): X has no column {missing}") from None
    except (TypeError, ValueError, IndexError) as failure:
        raise Invalid(errno.EINVAL, f"train(X, y): {failure}") from None
    return table, inputs, target, group


def _weighed(table: Dict[str, Any], weights: Sequence[float]) -> Tuple[Dict[str, Any], Any]:
    """The rows that count, and their weights."""
    numpy = package("numpy", "sample_weight")
    rows = len(next(iter(table.values())))
    found = numpy.asarray(weights, numpy.float64)
    if found.shape not in ((), (rows,)):
        raise Invalid(
            errno.EINVAL, f"sample_weight: expected one for each row, found {found.size} for {rows}"
        )
    found = numpy.broadcast_to(found, rows)
    if not (numpy.isfinite(found).all() and (found >= 0).all()):
        raise Invalid(errno.EINVAL, "sample_weight: expected finite numbers, 0 or more")
    if not found.any():
        raise Invalid(errno.EINVAL, "sample_weight: all are zero; no row counts")
    return {name: values[found > 0] for name, values in table.items()}, found[found > 0]


def train(
    data: Any,
    y: Any = None,
    *,
    inputs: Optional[Sequence[str]] = None,
    target: Optional[str] = None,
    group: Union[str, Sequence[Any], None] = None,
    sample_weight: Optional[Sequence[float]] = None,
    check: float = 0,
    seed: int = 1,
    mf: Union[str, Sequence[int], None] = None,
    mf_type: str = "gaussmf",
    epochs: int = 80,
    ridge: Optional[float] = None,
    classic: bool = False,
    all_rows: bool = False,
    progress: Optional[Callable[[TrainStep], object]] = None,
) -> Model:
    """Learn a model as `incise train` does: same data, options and seed give the same model.

    data: a list of sources, or one table, whose pairs are then all in memory; or with y the inputs X:
    an array, a DataFrame or {column: values}, of which all columns but the group's are inputs.
    inputs, target: names of the columns; by default depth_mm, velocity_mm_s and force_N, or with y
    those of X and of y. Models have them: a loop takes a model of depth_mm and velocity_mm_s.

    A list [source, …] is read twice in bounded memory, and files in it give the very file that the
    tool writes of them. A source is a CSV file, a recording (every force sample of its cuts), a table
    that can be read again (anything with ``__arrow_c_stream__``, a DataFrame, {column: values}), or a
    function that returns such a table anew each time it is called, with the same rows::

        def strokes():  # batch by batch
            file = pyarrow.parquet.ParquetFile("strokes.parquet")
            return pyarrow.RecordBatchReader.from_batches(file.schema_arrow, file.iter_batches())

        incise.train(["a.csv", "b.rec", ("strokes", strokes)], group="cut")

    (name, table) names a table; without one it is "source N" by its place in the list. The SHA-256 of
    the name takes the place of a file's in the random choices and in the notes of the model: with
    names, the order of the list changes nothing.

    One table is a CSV file, a recording (its pairs averaged in 12 × 10 bins, by cut), or a table as
    above. The tool places the functions of more than 20000 pairs by a random sample of them, and
    holds out other single rows where check is given without group; so does a list, [source] too.

    group: column that names the cut, or with y the cut of each row; cross-validation and check
    keep whole cuts together. In a list also "recording" or "rig"; cuts of different sources are
    different ones. Without it data are grouped by "cut" where all have it; "none" takes each row
    by itself.
    sample_weight: of each row of X, 0 or more: one of weight 2 counts as two; without check.
    check: share that is kept back, 0 to 1; its error is in ``model.report``.
    mf: membership functions of each input (default 5, 4; else 3 each), or "auto".
    classic: the method of MATLAB's anfis, with so many epochs; not for a list.
    all_rows: also take rows whose column ``advancing`` is 0, as X and y always do.
    progress: called with a :class:`incise.TrainStep` after each epoch and some 10 ms of computing,
    in another thread; an exception of it ends the training, as Ctrl-C does.
    """
    if mf_type not in _mf_types:
        raise Invalid(errno.EINVAL, f"mf_type={mf_type!r}: gaussmf or gbellmf")
    if not 0 <= check < 1:
        raise Invalid(errno.EINVAL, f"check={check!r}: a share from 0 to below 1")
    weights, whole = None, y is not None  # of X every row, to which its weights belong
    if whole:
        data, inputs, target, group = _table_of(data, y, inputs, target, group)
        if sample_weight is not None:
            data, weights = _weighed(data, sample_weight)
    if sample_weight is not None and (y is None or check):
        raise Invalid(errno.EINVAL, "sample_weight: only of rows of X and y, and without check")
    inputs = inputs or _INPUTS
    names = [*inputs, target or _TARGET]
    if group is not None and not isinstance(group, str):
        raise Invalid(
            errno.EINVAL, "group: expected the name of a column; of rows only with X and y"
        )
    counts = _mf_counts(mf, len(inputs))
    options = TrainOptionsStruct()
    function("incise_train_options_init")(options)
    options.epochs, options.seed = epochs, seed
    options.classic = classic
    if ridge is not None:
        options.ridge = ridge
    if isinstance(data, (list, tuple)):
        from ._corpus import train_sources

        return train_sources(
            data, names, options, group, check, all_rows, _mf_types[mf_type], counts, progress
        )
    if group is None and has_cuts(data):
        group = "cut"
    group = None if group == "none" else group
    # Not in this thread, whose KeyboardInterrupt a callback of the reading would swallow.
    dataset, left_out = _library.call_interruptible(
        lambda: _read_dataset(data, names, group, None if all_rows or whole else "advancing"),
        lambda: None,
    )
    stop = Stop(options, progress)
    training = _Training(dataset, check, options)
    if weights is not None:
        training.fit.pairs.weights = (c_double * len(weights))(*weights)

    def learn() -> Model:
        model = Model._of(start(training.fit.pairs, names, _mf_types[mf_type], counts, options))
        report = training.run(model)
        model._report = report_of(
            report,
            training.fit.pairs.n,
            training.check.pairs.n,
            left_out,
            (
                baselines(training.fit, training.check, options.progress)
                if training.has_check
                else None
            ),
        )
        return model

    try:
        return stop.run(learn)
    finally:
        training.close()


def load(path: PathLike) -> Union[Model, CompiledModel]:
    """Read a model, .fis or .fx."""
    name = _library.path_bytes(path)
    if is_recording(name) or os.path.isdir(name):
        raise Invalid(errno.EINVAL, f"{path}: is a recording; incise.open() reads it")
    return CompiledModel(path) if name.endswith(b".fx") else Model(path)
