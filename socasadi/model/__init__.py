"""Prediction-model families theta <-> (A, B, C, D), their bounds, and identification from records."""

from ._base import PredictionModel, StateSpace
from ._dense import Dense
from ._entry import Entry
from ._fixed import Fixed
from ._identify import bounds_from_record, identify, prediction_error, state_space_error
from ._modal import Modal
from ._record import Record
from ._subspace import subspace

__all__ = [
    "Dense",
    "Entry",
    "Fixed",
    "Modal",
    "PredictionModel",
    "Record",
    "StateSpace",
    "bounds_from_record",
    "identify",
    "prediction_error",
    "state_space_error",
    "subspace",
]
