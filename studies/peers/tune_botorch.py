"""BoTorch: `SingleTaskGP` and `LogExpectedImprovement`, as in its own first example."""

import warnings

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from botorch.acquisition import LogExpectedImprovement  # pyright: ignore[reportMissingImports]
from botorch.fit import fit_gpytorch_mll  # pyright: ignore[reportMissingImports]
from botorch.models import SingleTaskGP  # pyright: ignore[reportMissingImports]
from botorch.models.transforms import Normalize, Standardize  # pyright: ignore[reportMissingImports]
from botorch.optim import optimize_acqf  # pyright: ignore[reportMissingImports]
from gpytorch.mlls import ExactMarginalLogLikelihood  # pyright: ignore[reportMissingImports]

from socasadi.tune import Space


class BoTorch:
    """Double precision, the model's default priors and noise, 10 restarts from 512 points."""

    def __init__(self, space: Space, seed: int) -> None:
        torch.set_num_threads(1)
        torch.manual_seed(seed)
        self._bounds = torch.tensor([[0.0] * space.dimension, [1.0] * space.dimension], dtype=torch.double)
        self._points: list[np.ndarray] = []
        self._values: list[float] = []

    def ask(self) -> np.ndarray:
        points = torch.tensor(np.array(self._points), dtype=torch.double)
        values = torch.tensor(self._values, dtype=torch.double)[:, None]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of fits that are tried again
            normalised = Normalize(points.shape[1], bounds=self._bounds)
            model = SingleTaskGP(points, values, input_transform=normalised, outcome_transform=Standardize(m=1))
            fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
            improvement = LogExpectedImprovement(model, best_f=values.max())
            best, _ = optimize_acqf(improvement, bounds=self._bounds, q=1, num_restarts=10, raw_samples=512)
        return best.detach().numpy()[0]

    def tell(self, unit: np.ndarray, cost: float, failed: bool) -> None:
        self._points.append(unit)
        self._values.append(-cost)
