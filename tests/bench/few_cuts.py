# SPDX-License-Identifier: GPL-2.0-or-later
"""Errors of incise train on cuts that it has not seen, next to scikit-learn's.

    make check-few-cuts [DATA='a.csv b.csv …'] [SPLITS=4]

Tissues are ten simulated rigs and the given CSV files (a column cut, then depth, velocity and
force). In half of the splits 70 % of the cuts are for training, in the others 6 cuts; the rest is
unseen. Every method selects its own settings on the training cuts only, by cross-validation over
cuts. Prints per tissue and over all splits the ratio of the RMSE to that of the best peer of the same
split, the splits in which a method is more than 2 % worse than the plane or the mean, and the
share of unseen pairs in the 95 % interval of incise.

Inputs are not clamped to the range of the training cuts, as in the error that incise train --check
reports. (The loop clamps them: where unseen cuts are deeper than all training cuts, its error is larger.)
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
SPLITS = int(os.environ.get("SPLITS") or 4)
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
    recording, pairs = (os.path.join(folder, "rig%02d%s" % (number, end)) for end in (".rec", ".csv"))
    rig = "sim:seed=%d,clock=simulated%s" % (SEED + number, keys)
    incise("capture", "-o", recording, "--rig", rig)
    incise("export", recording, "-o", pairs, "--average", "12x10", "--by-cut")
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
    incise("train", data, "--inputs", "depth,velocity", "--group", "cut", "-o", model, "--overwrite")
    text = incise("eval", model, "--sd", "--no-clamp", text="".join("%.17g %.17g\n" % tuple(row) for row in unseen))
    return numpy.array([line.split()[:2] for line in text.splitlines()], dtype=float).T


def measure(folder, x, y, cut, training):
    fit = numpy.isin(cut, training)
    truth = y[~fit]

    def rmse(predicted):
        return float(numpy.sqrt(numpy.mean((predicted - truth) ** 2)))

    result = {name: rmse(f(x[~fit])) for name, f in peers(x[fit], y[fit], cut[fit]).items()}
    best = min(result, key=result.get)
    predicted, sd = ours(folder, x[fit], y[fit], cut[fit], x[~fit])
    result["incise train"] = rmse(predicted)
    inside = float(numpy.mean(numpy.abs(predicted - truth) <= 1.959964 * sd))
    return {"rmse_N": result, "best_peer": best, "inside": inside}


def table(title, results):
    print("\n%s: %d splits" % (title, len(results)))
    print("%-18s%8s%8s%8s%20s%8s" % ("RMSE / best peer", "median", "90 %", "most", "> 1.02 × plane/mean", "most"))
    for name in results[0]["rmse_N"]:
        ratio = [r["rmse_N"][name] / r["rmse_N"][r["best_peer"]] for r in results]
        simple = [
            r["rmse_N"][name] / min(r["rmse_N"]["mean"], r["rmse_N"]["linear"]) for r in results
        ]
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
        print("%-12s%-8s%6s%6s  %-18s%10s%8s%8s" % ("tissue", "split", "cuts", "pairs", "best peer", "RMSE / N", "ratio", "inside"))
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
                best = r["rmse_N"][r["best_peer"]]
                print(
                    "%-12s%-8s%6d%6d  %-18s%10.4f%8.3f%8.3f"
                    % (name, kind, len(training), numpy.isin(cut, training).sum(), r["best_peer"], best, r["rmse_N"]["incise train"] / best, r["inside"]),
                    flush=True,
                )
    for kind in "70 %", "6 cuts":
        table("training on " + kind, [r for r in results if r["kind"] == kind])
    table("all", results)
    print("\nshare of unseen pairs in the 95 % interval")
    for name in dict.fromkeys(r["tissue"] for r in results):
        print("%-12s%8.3f" % (name, numpy.mean([r["inside"] for r in results if r["tissue"] == name])))
    print("%-12s%8.3f" % ("all", numpy.mean([r["inside"] for r in results])))
    print("\nfailures: %s" % ("; ".join(failures) or "none"))
    if os.environ.get("RESULTS"):
        with open(os.environ["RESULTS"], "w", encoding="ascii") as file:
            json.dump(results, file)


main()
