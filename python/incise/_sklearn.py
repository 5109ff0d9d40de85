# SPDX-License-Identifier: LGPL-2.1-or-later
"""The model as an estimator of scikit-learn, for its pipelines, cross-validation and searches."""

from __future__ import annotations

from typing import Any, Optional, Sequence, Union

from ._library import package

numpy = package("numpy", "ForceRegressor")
package("sklearn", "ForceRegressor")
from sklearn.base import BaseEstimator, RegressorMixin  # noqa: E402
from sklearn.utils.validation import check_is_fitted  # noqa: E402

from ._model import INPUTS_MAX, train

try:  # scikit-learn 1.6 and later
    from sklearn.utils.validation import validate_data as _validate
except ImportError:

    def _validate(estimator: Any, *args: Any, **options: Any) -> Any:
        options.pop("skip_check_array", None)
        return estimator._validate_data(*args, **options)


class ForceRegressor(RegressorMixin, BaseEstimator):
    """A Takagi-Sugeno model of up to eight inputs, learnt by :func:`incise.train`.

    Parameters
    ----------
    mf : "auto" (default): membership functions by cross-validation, or their counts: (5, 4) of incise.train
    mf_type : "gaussmf" or "gbellmf"
    ridge, seed : as of :func:`incise.train`

    Attributes
    ----------
    model_ : the :class:`incise.Model`
    n_features_in_ : number of inputs
    """

    def __init__(
        self,
        *,
        mf: Union[str, Sequence[int]] = "auto",
        mf_type: str = "gaussmf",
        ridge: Optional[float] = None,
        seed: int = 1,
    ):
        self.mf = mf
        self.mf_type = mf_type
        self.ridge = ridge
        self.seed = seed

    def fit(
        self, X: Any, y: Any, groups: Any = None, sample_weight: Any = None
    ) -> "ForceRegressor":
        """Learn; groups: the cut of each row, which cross-validation keeps together;
        sample_weight: a row of weight 2 counts as two.

        The model's names are those of the columns of a DataFrame and of a Series y."""
        target = getattr(y, "name", None)
        X, y = _validate(self, X, y, dtype=numpy.float64, y_numeric=True, ensure_min_samples=2)
        if X.shape[1] > INPUTS_MAX:
            raise ValueError(
                f"X has {X.shape[1]} features; a model has at most {INPUTS_MAX} inputs"
            )
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(X.shape[1])])
        self.model_ = train(
            X,
            y,
            inputs=[str(name) for name in names],
            target=target if isinstance(target, str) else "y",
            group=groups,
            sample_weight=sample_weight,
            seed=self.seed,
            mf=self.mf,
            mf_type=self.mf_type,
            ridge=self.ridge,
        )
        return self

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Outputs; with return_std=True (outputs, standard deviations)."""
        check_is_fitted(self, "model_")
        X = _validate(self, X, dtype=numpy.float64, reset=False)
        return self.model_(X, sd=return_std)
