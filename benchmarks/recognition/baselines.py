"""Peers of the echo-state experts, from trivial to classical, in the same folds; see also `motion_templates`.

They stay in the table where they win.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from benchmarks.recognition.alignment import warping_distances
from benchmarks.recognition.methods import Prepare, Scorer, forced_scorer, learned_by_class
from controller.learning.recognition.experts import ExpertRecipe, Forced, expert_reservoir, force
from controller.motion.rotations import Array, Indices


def mean_pose(signals: list[Array], labels: Indices, classes: int) -> Scorer:
    """The class whose mean frame is nearest to the clip's mean frame."""
    means = np.array([signal.mean(0) for signal in signals])

    def score(learn: Indices, ask: Indices) -> Array:
        costs = np.full((len(ask), classes), np.inf)
        for label, own in enumerate(learned_by_class(learn, labels, classes)):
            if len(own):
                costs[:, label] = np.linalg.norm(means[ask] - means[own].mean(0), axis=1)
        return costs

    return score


def frame_gaussians(shrinkage: float = 0.1) -> Prepare:
    """One Gaussian a class over single frames (quadratic discriminant): the mean negative log density of a clip.

    Args:
        shrinkage: what is added to the covariance's diagonal, relative to its mean.
    """

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        def score(learn: Indices, ask: Indices) -> Array:
            costs = np.full((len(ask), classes), np.inf)
            for label, own in enumerate(learned_by_class(learn, labels, classes)):
                if len(own):
                    density = Gaussian(np.concatenate([signals[i] for i in own]), shrinkage)
                    costs[:, label] = [density.surprise(signals[i]).mean() for i in ask]
            return costs

        return score

    return prepare


class Gaussian:
    """A Gaussian fitted to frames (T, C).

    Args:
        frames: what it is fitted to.
        shrinkage: what is added to the covariance's diagonal, relative to its mean.
    """

    def __init__(self, frames: Array, shrinkage: float) -> None:
        self.mean = frames.mean(0)
        covariance = np.atleast_2d(np.cov(frames.T, bias=True))
        covariance += np.eye(len(covariance)) * max(shrinkage * float(np.trace(covariance)) / len(covariance), 1e-9)
        self._factor = cho_factor(covariance)
        self._log_volume = float(np.log(np.diag(self._factor[0])).sum())

    def surprise(self, frames: Array) -> Array:
        """The negative log density of frames (T, C), up to a constant, shape (T,)."""
        off = frames - self.mean
        return 0.5 * np.einsum("ij,ji->i", off, cho_solve(self._factor, off.T)) + self._log_volume


def linear_experts(order: int, ridge: float) -> Prepare:
    """Experts without a reservoir: the next frame is a linear function of the last few (vector autoregression)."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        return forced_scorer([lagged(signal, order) for signal in signals], labels, classes, ridge, centred=True)

    return prepare


def lagged(signal: Array, order: int) -> Forced:
    """The last `order` frames and a constant as the state from which the next frame is told.

    Before the first frame there is the first frame.
    """
    before = np.concatenate([np.repeat(signal[:1], order - 1, axis=0), signal])
    count = len(signal) - 1
    past = [before[order - 1 - k : order - 1 - k + count] for k in range(order)]
    return Forced(np.column_stack([*past, np.ones(count)]), signal[1:])


def nearest_by_warping(signals: list[Array], labels: Indices, classes: int) -> Scorer:
    """The class of the nearest learned clip under dynamic time warping (1-NN DTW)."""
    distances = np.array([warping_distances(signal, signals) for signal in signals])
    return nearest(distances, labels, classes)


def nearest(distances: Array, labels: Indices, classes: int) -> Scorer:
    """The nearest learned example of each class, given all distances (n, n)."""

    def score(learn: Indices, ask: Indices) -> Array:
        costs = np.full((len(ask), classes), np.inf)
        for label, own in enumerate(learned_by_class(learn, labels, classes)):
            if len(own):
                costs[:, label] = distances[np.ix_(ask, own)].min(1)
        return costs

    return score


def eros(signals: list[Array], labels: Indices, classes: int) -> Scorer:
    """Extended Frobenius norm (Yang and Shahabi 2004): 1-NN by the angles between principal axes.

    Eros(A, B) = sum_i w_i |<a_i, b_i>| over the eigenvectors of the two covariance matrices; the weights w are the mean
    normalised eigenvalues of the learned clips.
    """
    values, axes = zip(*(np.linalg.eigh(np.atleast_2d(np.cov(s.T, bias=True))) for s in signals), strict=True)
    strength = np.array(values)[:, ::-1].clip(0.0)
    strength /= np.maximum(strength.sum(1, keepdims=True), 1e-12)
    principal = np.array(axes)[:, :, ::-1]

    def score(learn: Indices, ask: Indices) -> Array:
        weights = strength[learn].mean(0)
        cosines = np.abs(np.einsum("aci,bci->abi", principal[ask], principal[learn]))
        similarity = cosines @ (weights / weights.sum())
        costs = np.full((len(ask), classes), np.inf)
        for label in np.unique(labels[learn]):
            costs[:, label] = -similarity[:, labels[learn] == label].max(1)
        return costs

    return score


def conceptor_evidence(recipe: ExpertRecipe, aperture: float = 30.0) -> Prepare:
    """Positive conceptor evidence on the experts' reservoir (Jaeger 2014, section 3.12), centred.

    C_j = R_j (R_j + aperture^-2 I)^-1 of the states of class j; how well a clip fits is the share x' C_j x / |x|^2 of
    its states' energy that C_j lets pass. The cost is the log of what it stops, less its mean over the learned clips.
    """

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        reservoir = expert_reservoir(recipe, signals[0].shape[1])
        forced = force(reservoir, signals, recipe.washout)
        correlation = np.array([f.states.T @ f.states for f in forced])
        frames = np.array([len(f.states) for f in forced], dtype=float)
        energy = np.trace(correlation, axis1=1, axis2=2)

        def score(learn: Indices, ask: Indices) -> Array:
            costs = np.full((len(ask), classes), np.inf)
            for label, own in enumerate(learned_by_class(learn, labels, classes)):
                if len(own):
                    mean = correlation[own].sum(0) / frames[own].sum()
                    stops = np.linalg.inv(np.eye(len(mean)) + aperture**2 * mean)  # I - C
                    stopped = np.log(np.einsum("kij,ij->k", correlation, stops) / energy)
                    costs[:, label] = stopped[ask] - stopped[learn].mean()
            return costs

        return score

    return prepare
