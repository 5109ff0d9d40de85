# SPDX-License-Identifier: GPL-2.0-or-later
"""Regressors of scikit-learn on the pairs of incise bench training.

Usage: scikit_learn.py QUESTION.json, with "train", a list of lists of [depth, velocity,
force], and "unseen", one such list. Prints a list of figures per regressor. Exits with 3
where there is no scikit-learn.
"""
import json
import os
import sys
import time
import warnings

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
try:
    import numpy
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    from sklearn.kernel_ridge import KernelRidge
    from sklearn.model_selection import GridSearchCV, GroupKFold
    from sklearn.neural_network import MLPRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
except ImportError:
    sys.exit(3)

PER_CUT = 10


def gaussian_process(groups):
    kernel = ConstantKernel() * RBF([1, 1]) + WhiteKernel(0.01)
    return make_pipeline(StandardScaler(),
                         GaussianProcessRegressor(kernel, normalize_y=True,
                                                  n_restarts_optimizer=2, random_state=1))


def neural_network(groups):
    return make_pipeline(StandardScaler(),
                         MLPRegressor((16, 16), solver="lbfgs", alpha=0.1, max_iter=500,
                                      random_state=1))


def kernel_ridge(groups):
    grid = {"kernelridge__alpha": [0.001, 0.01, 0.1, 1],
            "kernelridge__gamma": [0.03, 0.1, 0.3, 1]}
    folds = list(GroupKFold(6).split(groups, groups=groups))
    return GridSearchCV(make_pipeline(StandardScaler(), KernelRidge(kernel="rbf")), grid, cv=folds)


def measure(make, train, unseen):
    train = numpy.array(train)
    groups = numpy.arange(len(train)) // PER_CUT
    start = time.perf_counter()
    model = make(groups).fit(train[:, :2], train[:, 2])
    seconds = time.perf_counter() - start
    error = numpy.abs(model.predict(unseen[:, :2]) - unseen[:, 2])
    return {"seconds": seconds, "rmse": float(numpy.sqrt(numpy.mean(error ** 2))),
            "max": float(error.max()), "mean": float(error.mean())}


def main():
    warnings.simplefilter("ignore")
    with open(sys.argv[1], encoding="ascii") as file:
        question = json.load(file)
    unseen = numpy.array(question["unseen"])
    answer = {}
    for make in gaussian_process, neural_network, kernel_ridge:
        if len(question["train"]) > 2:  # warms up
            measure(make, question["train"][0], unseen)
        answer[make.__name__] = [measure(make, train, unseen) for train in question["train"]]
    json.dump(answer, sys.stdout)


main()
