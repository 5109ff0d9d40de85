# SPDX-License-Identifier: GPL-2.0-or-later
"""Errors and intervals of incise train on real cuts that it has not seen, next to its peers.

    make bench-learning [DATA=../shared/data] [SPLITS=4] [SEED=0]

Of each set 60 % of the cuts are for training, drawn by the printed seed; the rest is unseen. A
method selects its settings on the training cuts only, by cross-validation over cuts, and inputs are
clamped to the range of those cuts, as the loop clamps them. Each runs on one processor. Predictions
of peers are kept in build/tests/bench/learned until this file, scikit-learn or LightGBM changes.
"""

import hashlib
import json
import os
import pickle
import resource
import subprocess
import tempfile
import time
import warnings
from functools import partial
from importlib.metadata import version

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
import numpy
from lightgbm import LGBMRegressor
from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
from sklearn.dummy import DummyRegressor
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.gaussian_process import GaussianProcessRegressor, kernels
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, SplineTransformer, StandardScaler

# File, inputs (the first is the depth, by whose thirds pairs are counted), output, group.
SETS = [
    ("meniscus.csv", "depth_deg velocity_deg_s", "force_N", "cut"),
    ("skin.csv", "depth_deg velocity_deg_s", "force_N", "cut"),
    ("kiwi.csv", "depth_mm velocity_mm_s", "force_N", "cut"),
    ("mango.csv", "depth_mm velocity_mm_s", "force_N", "cut"),
    ("davinci.csv", "depth_mm velocity_mm_s torque_back", "force_N", "cut"),
]
BUILD, DATA = os.environ["INCISE_BUILD"], os.environ["DATA"]
SPLITS, SEED = int(os.environ["SPLITS"]), int(os.environ["SEED"])


def folds(cut):
    order = numpy.random.default_rng(0).permutation(numpy.unique(cut))
    for fold in range(min(5, len(order))):
        held = numpy.isin(cut, order[fold :: min(5, len(order))])
        yield numpy.flatnonzero(~held), numpy.flatnonzero(held)


def peer(model, grid, x, y, cut):
    """An estimator of scikit-learn, at the settings of the grid that are best on held-out cuts."""
    if grid:
        model = GridSearchCV(model, grid, cv=list(folds(cut)), scoring="neg_mean_squared_error")
    model = model.fit(x, y)
    return model.predict, getattr(model, "best_estimator_", model)


def gaussian_process(x, y, cut):
    some = numpy.random.default_rng(0).permutation(len(y))[:350]  # more take minutes
    shape = kernels.ConstantKernel() * kernels.RBF(numpy.ones(x.shape[1]))
    kernel = shape + kernels.WhiteKernel(0.1)
    model = GaussianProcessRegressor(kernel, normalize_y=True, random_state=1)
    return peer(scaled(model), {}, x[some], y[some], cut[some])


def conformal_quantiles(x, y, cut):
    """No peer of the error: the interval that others are scored by."""
    how = {"loss": "quantile", "max_iter": 60, "max_leaf_nodes": 8, "random_state": 1}
    ends = [HistGradientBoostingRegressor(quantile=q, **how) for q in (0.025, 0.975)]

    def between(rows, z):
        return numpy.sort([end.fit(x[rows], y[rows]).predict(z) for end in ends], axis=0)

    miss = []
    for rows, held in folds(cut):
        low, high = between(rows, x[held])
        miss.extend(numpy.maximum(low - y[held], y[held] - high))
    more = numpy.quantile(miss, min(1, 0.95 * (1 + 1 / len(miss))), method="higher")
    return lambda z: [z[:, 0], *(between(slice(None), z) + [[-more], [more]])], ends


def incise_train(x, y, cut):
    """By the programs, as a user does; and its interval of 95 %."""
    folder = tempfile.TemporaryDirectory()
    names = ",".join("x%d" % i for i in range(x.shape[1]))
    data, model = os.path.join(folder.name, "train.csv"), os.path.join(folder.name, "m.fis")
    rows = numpy.column_stack([cut, x, y])
    numpy.savetxt(data, rows, "%.17g", ",", header="cut,%s,force_N" % names, comments="")
    run("train", data, "--inputs", names, "--group", "cut", "-o", model)

    def predict(z):
        points = "".join(" ".join("%.17g" % v for v in row) + "\n" for row in z)
        text = run("eval", model, "--uncertainty", "total", text=points)
        force, sd = numpy.array([line.split()[:2] for line in text.splitlines()], float).T
        folder.cleanup()
        return [force, force - 1.959964 * sd, force + 1.959964 * sd]

    with open(model, "rb") as file:
        return predict, file.read()


def run(*command, text=None):
    """Return the output. Warnings, for example of rules that never fire, would interrupt the table."""
    command = os.path.join(BUILD, "bin/incise"), *command
    done = subprocess.run(command, capture_output=True, text=True, input=text)
    if done.returncode:
        raise SystemExit(done.stderr)
    return done.stdout


scaled = partial(make_pipeline, StandardScaler())


SQUARE = "depth", PolynomialFeatures(2, include_bias=False), [0]
SQUARED = ColumnTransformer([SQUARE], remainder="passthrough")
PERCEPTRON = MLPRegressor(solver="lbfgs", max_iter=400, hidden_layer_sizes=(16, 8), random_state=1)
METHODS = {
    "mean": partial(peer, DummyRegressor(), {}),
    "plane": partial(peer, LinearRegression(), {}),
    "quadratic": partial(peer, make_pipeline(SQUARED, LinearRegression(fit_intercept=False)), {}),
    "nearest neighbours": partial(
        peer, scaled(KNeighborsRegressor()),
        {"kneighborsregressor__n_neighbors": [1, 3, 5, 10, 20, 50, 100]}),
    "histogram boosting": partial(
        peer, HistGradientBoostingRegressor(min_samples_leaf=10, random_state=1),
        {"max_iter": [40, 120], "max_leaf_nodes": [3, 8], "learning_rate": [0.05, 0.1]}),
    "LightGBM": partial(
        peer, LGBMRegressor(n_jobs=1, verbose=-1, random_state=1, subsample=0.7, subsample_freq=1),
        {"n_estimators": [40, 120], "num_leaves": [3, 8], "learning_rate": [0.05, 0.1]}),
    "random forest": partial(
        peer, RandomForestRegressor(60, random_state=1), {"min_samples_leaf": [5, 20, 60]}),
    "Gaussian process": gaussian_process,
    "splines": partial(
        peer, make_pipeline(SplineTransformer(6), PolynomialFeatures(2), Ridge()),
        {"ridge__alpha": [0.01, 0.1, 1, 10, 100]}),
    "perceptron": partial(
        peer, TransformedTargetRegressor(scaled(PERCEPTRON), transformer=StandardScaler()),
        {"regressor__mlpregressor__alpha": [0.1, 3]}),
    "conformal quantiles": conformal_quantiles,
    "incise train": incise_train,
}
PEERS = [name for name in METHODS if name not in ("conformal quantiles", "incise train")]


def spent():
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def learned(name, *given):
    """Predicted at unseen inputs (force, ends of an interval), seconds of training, bytes."""
    method, (*training, unseen) = METHODS[name], given
    with open(__file__, "rb") as file:
        key = hashlib.sha256(file.read())
    for part in name, version("scikit-learn"), version("lightgbm"):
        key.update(part.encode())
    for part in given:
        key.update(part.tobytes())
    path = os.path.join(BUILD, "tests/bench/learned", key.hexdigest()[:32])
    if os.path.exists(path):
        with open(path, "rb") as file:
            return pickle.load(file)
    begin = spent()
    predict, model = method(*training)
    result = {"seconds": spent() - begin, "bytes": len(pickle.dumps(model))}
    result["predicted"] = numpy.atleast_2d(predict(unseen))
    if method is not incise_train:  # its programs change
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "wb") as file:
            pickle.dump(result, file)
    return result


def measure(number, split):
    """By method: seconds, bytes, RMSE; of intervals the share inside, by thirds too, the score."""
    file, inputs, output, group = SETS[number]
    path = os.path.join(DATA, file)
    table = numpy.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")
    x = numpy.column_stack([table[name] for name in inputs.split()]).astype(float)
    y, cut = table[output].astype(float), numpy.unique(table[group], return_inverse=True)[1]
    order = numpy.random.default_rng([SEED + split, number]).permutation(cut.max() + 1)
    fit = numpy.isin(cut, order[: round(0.6 * len(order))])
    unseen, truth = numpy.clip(x[~fit], x[fit].min(0), x[fit].max(0)), y[~fit]
    result = {}
    for name in METHODS:
        result[name] = r = learned(name, x[fit], y[fit], cut[fit], unseen)
        force, *ends = r.pop("predicted")
        r["rmse"] = numpy.sqrt(numpy.mean((force - truth) ** 2))
        if ends:
            miss = numpy.maximum(0, numpy.maximum(ends[0] - truth, truth - ends[1]))
            thirds = numpy.array_split(numpy.argsort(x[~fit, 0], kind="stable"), 3)
            r["inside"] = [(miss == 0).mean(), *((miss[third] == 0).mean() for third in thirds)]
            r["score"] = (ends[1] - ends[0] + 2 / 0.05 * miss).mean()
    return result


def print_set(name, ours):
    """The row of a set: means of its splits."""
    ratio = [r["incise train"]["rmse"] / min(r[n]["rmse"] for n in PEERS) for r in ours]
    inside = numpy.mean([r["incise train"]["inside"] for r in ours], axis=0)
    score = [r["incise train"]["score"] / r["conformal quantiles"]["score"] for r in ours]
    row = numpy.mean(ratio), *inside, numpy.mean(score)
    print("%-12s%10.3f%10.3f%9.3f%8.3f%7.3f%22.3f" % (name, *row), flush=True)


def print_methods(results):
    columns = "median", "90 %", "worst", "> 1.02 simple", "best", "CPU s", "bytes"
    print("\n%-20s%9s%9s%9s%15s%6s%8s%10s" % ("RMSE / best peer", *columns))
    for name in [*PEERS, "incise train"]:
        best, simple, own = (
            numpy.array([min(r[n]["rmse"] for n in names) for r in results])
            for names in (PEERS, ("mean", "plane"), [name]))
        quantiles = numpy.quantile(own / best, [0.5, 0.9, 1])
        spent = [numpy.median([r[name][key] for r in results]) for key in ("seconds", "bytes")]
        row = *quantiles, sum(own > 1.02 * simple), sum(own <= best), *spent
        print("%-20s%9.3f%9.3f%9.3f%15d%6d%8.2f%10d" % (name, *row))


def main():
    warnings.simplefilter("ignore")
    sets = [n for n, (file, *_) in enumerate(SETS) if os.path.exists(os.path.join(DATA, file))]
    if not sets:
        print("bench-learning: skipped: %s has none of its sets" % DATA)
        return
    print("%d splits of each set, seed %d; inside: the share of unseen pairs in the 95 %% interval,"
          " also by thirds of depth" % (SPLITS, SEED))
    columns = "RMSE/best", "inside", "shallow", "middle", "deep", "score / conformal's"
    print("%-12s%10s%10s%9s%8s%7s%22s" % ("set", *columns))
    results = []
    for number in sets:
        results += [measure(number, split) for split in range(SPLITS)]
        print_set(SETS[number][0].split(".")[0], results[-SPLITS:])
    print_methods(results)
    with open(os.path.join(BUILD, "tests/bench/learning.json"), "w", encoding="ascii") as file:
        json.dump({"seed": SEED, "splits": results}, file, default=float)


main()
