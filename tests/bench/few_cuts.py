# SPDX-License-Identifier: GPL-2.0-or-later
"""Errors of incise train on cuts that it has not seen, next to scikit-learn's.

    make check-few-cuts [DATA='a.csv b.csv …'] [SPLITS=4]

Tissues are ten simulated rigs and the given CSV files (a column cut, then depth, velocity and
force). In half of the splits 70 % of the cuts are for training, in the others 6 cuts; the rest is
unseen. Every method selects its own settings on the training cuts only, by cross-validation over
cuts. Prints the ratio of the RMSE to that of the best peer of the same split, the splits in which a
method is more than 2 % worse than the plane or the mean, and the share of unseen pairs in the 95 %
interval of incise.

Inputs are not clamped to the range of the training cuts, as in the error that incise train --check
reports. The loop clamps them: its error is larger if unseen cuts are deeper than all training cuts.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
import warnings

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
try:
    import numpy
    from sklearn.ensemble import GradientBoostingRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    from sklearn.linear_model import LinearRegression
    from sklearn.model_selection import GridSearchCV
    from sklearn.neighbors import KNeighborsRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
except ImportError:
    sys.exit("few_cuts.py: skipped: scikit-learn is missing; make python-peers installs it")

INCISE = os.path.join(os.environ["INCISE_BUILD"], "bin", "incise")
SPLITS = max(2, int(os.environ.get("SPLITS") or 4))
SEED = int(os.environ.get("SEED") or 2000)  # not one of those used for development
FEW = 6
GP_PAIRS = 300  # a Gaussian process of more takes minutes

# Tissue, roughness and noise of the simulated rigs.
RIGS = [
    "",
    ",boundary=0.3,depth_mm=15,times=6",
    ",boundary=0.2,tooth=0.5",
    ",boundary=0.05,tooth=0.05",
    ",viscous=2,viscous_mm_s=40,elastic1_N_mm=0.02",
    ",elastic2_N_mm2=0,viscous=0,boundary=0.15",
    ",boundary=0.3,tooth=0.8,tooth_mm=6,elastic2_N_mm2=0.001",
    ",elastic1_N_mm=0.12,elastic2_N_mm2=0,viscous=1,boundary=0.2,depth_mm=8,times=10",
    ",force_noise_mV=15,boundary=0.1,elastic1_N_mm=0.01,elastic2_N_mm2=0.0005",
    ",boundary=0.25,tooth=0.3,speed_mm_s=60,viscous=3,viscous_mm_s=60",
]


def incise(*command, text=None):
    return subprocess.run(
        [INCISE, *command], check=True, capture_output=True, text=True, input=text
    ).stdout


def simulate(folder, number, keys):
    recording = os.path.join(folder, "rig%02d.rec" % number)
    pairs = os.path.join(folder, "rig%02d.csv" % number)
    rig = "sim:seed=%d,clock=simulated%s" % (SEED + number, keys)
    incise("capture", "-o", recording, "--rig", rig)
    incise("export", recording, "-o", pairs, "--average", "12x10,by-cut")
    return pairs


def load(path):
    """Inputs, force, and number of the cut of each row in which the blade advanced."""
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    rows = [row for row in rows if float(row.get("advancing", 1)) > 0]
    cuts = sorted({row["cut"] for row in rows})
    columns = list(rows[0])[1:3]
    x = numpy.array([[float(row[column]) for column in columns] for row in rows])
    y = numpy.array([float(row["force_N"]) for row in rows])
    return x, y, numpy.array([cuts.index(row["cut"]) for row in rows])


def splits(tissue, cuts):
    for number in range(SPLITS):
        order = numpy.random.default_rng([SEED + number, tissue]).permutation(cuts)
        few = number % 2 == 1
        count = min(FEW, cuts - 1) if few else round(0.7 * cuts)
        yield "6 cuts" if few else "70 %", order[:count]


def folds(cut):
    order = numpy.random.default_rng(0).permutation(numpy.unique(cut))
    n = min(5, len(order))
    for fold in range(n):
        held = numpy.isin(cut, order[fold::n])
        yield numpy.flatnonzero(~held), numpy.flatnonzero(held)


def search(model, grid, cut):
    return GridSearchCV(model, grid, cv=list(folds(cut)), scoring="neg_mean_squared_error")


def peers(x, y, cut):
    """Fitted peers by name."""
    least = min(len(fit) for fit, _ in folds(cut))
    some = numpy.random.default_rng(0).permutation(len(y))[:GP_PAIRS]
    kernel = ConstantKernel() * RBF([1, 1]) + WhiteKernel(0.1)
    nearest = make_pipeline(StandardScaler(), KNeighborsRegressor())
    process = make_pipeline(
        StandardScaler(), GaussianProcessRegressor(kernel, normalize_y=True, random_state=1)
    )
    boosting = GradientBoostingRegressor(
        subsample=0.7, learning_rate=0.08, min_samples_leaf=10, random_state=1
    )
    ks = [k for k in (1, 3, 5, 10, 20, 50, 100) if k <= least]
    return {
        "mean": lambda z: numpy.full(len(z), y.mean()),
        "linear": LinearRegression().fit(x, y).predict,
        "k-NN": search(nearest, {"kneighborsregressor__n_neighbors": ks}, cut).fit(x, y).predict,
        "Gaussian process": process.fit(x[some], y[some]).predict,
        "gradient boosting": search(
            boosting, {"n_estimators": [30, 100], "max_depth": [1, 2, 3]}, cut
        )
        .fit(x, y)
        .predict,
    }


def ours(folder, x, y, cut, unseen):
    """Prediction and its standard deviation, by the programs."""
    data, model = os.path.join(folder, "train.csv"), os.path.join(folder, "m.fis")
    with open(data, "w", encoding="ascii") as file:
        file.write("cut,depth,velocity,force_N\n")
        for c, (depth, velocity), force in zip(cut, x, y):
            file.write("%d,%.17g,%.17g,%.17g\n" % (c, depth, velocity, force))
    inputs = ["--inputs", "depth,velocity", "--group", "cut"]
    incise("train", data, *inputs, "-o", model, "--overwrite")
    lines = "".join("%.17g %.17g\n" % tuple(row) for row in unseen)
    text = incise("eval", model, "--uncertainty", "total", "--no-clamp", text=lines)
    return numpy.array([line.split()[:2] for line in text.splitlines()], dtype=float).T


def measure(folder, x, y, cut, training):
    fit = numpy.isin(cut, training)
    unseen, truth = x[~fit], y[~fit]
    predicted = {name: f(unseen) for name, f in peers(x[fit], y[fit], cut[fit]).items()}
    predicted["incise train"], sd = ours(folder, x[fit], y[fit], cut[fit], unseen)
    error = {name: numpy.abs(p - truth) for name, p in predicted.items()}
    within = numpy.all((unseen >= x[fit].min(0)) & (unseen <= x[fit].max(0)), axis=1)

    def rmse(mask):
        return {name: float(numpy.sqrt(numpy.mean(e[mask] ** 2))) for name, e in error.items()}

    return {
        "rmse_N": rmse(slice(None)),
        "rmse_within_N": rmse(within),
        "inside": float(numpy.mean(error["incise train"] <= 1.959964 * sd)),
    }


def best_peer(rmse):
    return min((name for name in rmse if name != "incise train"), key=rmse.get)


def table(title, results):
    """Of a list of the RMSE by method."""
    print("\n%s: %d splits" % (title, len(results)))
    names = ("RMSE / best peer", "median", "90 %", "most", "> 1.02 × plane/mean", "most")
    print("%-18s%8s%8s%8s%20s%8s" % names)
    for name in results[0]:
        ratio = [r[name] / r[best_peer(r)] for r in results]
        simple = [r[name] / min(r["mean"], r["linear"]) for r in results]
        print(
            "%-18s%8.3f%8.3f%8.3f%20d%8.3f"
            % (
                name,
                numpy.median(ratio),
                numpy.quantile(ratio, 0.9),
                max(ratio),
                sum(s > 1.02 for s in simple),
                max(simple),
            )
        )


def main():
    warnings.simplefilter("ignore")
    results, failures = [], []
    with tempfile.TemporaryDirectory() as folder:
        files = [simulate(folder, i + 1, keys) for i, keys in enumerate(RIGS)] + sys.argv[1:]
        names = "tissue", "split", "cuts", "pairs", "best peer", "RMSE / N", "ratio", "inside"
        print("%-12s%-8s%6s%6s  %-18s%10s%8s%8s" % names)
        for number, path in enumerate(files):
            name = os.path.basename(path)[:-4]
            x, y, cut = load(path)
            for kind, training in splits(number, cut.max() + 1):
                try:
                    r = measure(folder, x, y, cut, training)
                except subprocess.CalledProcessError as error:
                    failures.append("%s, %s: %s" % (name, kind, error.stderr.strip()))
                    continue
                results.append(dict(r, tissue=name, kind=kind))
                rmse, peer = r["rmse_N"], best_peer(r["rmse_N"])
                print(
                    "%-12s%-8s" % (name, kind),
                    "%5d%6d" % (len(training), numpy.isin(cut, training).sum()),
                    " %-18s%10.4f" % (peer, rmse[peer]),
                    "%7.3f%8.3f" % (rmse["incise train"] / rmse[peer], r["inside"]),
                    flush=True,
                )
    for kind in "70 %", "6 cuts":
        table("training on " + kind, [r["rmse_N"] for r in results if r["kind"] == kind])
    table("all", [r["rmse_N"] for r in results])
    table("all, pairs within the range of the training cuts", [r["rmse_within_N"] for r in results])
    print("\nshare of unseen pairs in the 95 % interval")
    for name in dict.fromkeys(r["tissue"] for r in results):
        inside = [r["inside"] for r in results if r["tissue"] == name]
        print("%-12s%8.3f" % (name, numpy.mean(inside)))
    print("%-12s%8.3f" % ("all", numpy.mean([r["inside"] for r in results])))
    print("\nfailures: %s" % ("; ".join(failures) or "none"))
    if os.environ.get("RESULTS"):
        with open(os.environ["RESULTS"], "w", encoding="ascii") as file:
            json.dump(results, file)


main()
