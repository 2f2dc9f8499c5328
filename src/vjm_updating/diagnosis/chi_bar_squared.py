"""How much of mere noise the trials of one effect explain: projections onto cones, and their distribution.

An effect with one size and a shape that is not known, of which most can have one sign only, is a mixture of its
trials with amounts that are not negative. What such a mixture explains at most of white noise is the squared length
of the projection onto the trials' cone. It is distributed as a mixture of chi-squared distributions. They have as
many degrees of freedom as trials share in the projection, weighted by how often they do (chi-bar-squared: Kudô,
Biometrika 50, 1963, p. 403; Shapiro, International Statistical Review 56, 1988, p. 49). A narrow cone is hardly
more than one direction, however many it spans.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.observation.distributions import chi2_sf

DRAWS, SEED = numerical(4000), numerical(19630612)
"""Of noise, from which the weights of a cone follow."""
STEEP = numerical(1e6)
"""Condition of a face's products from which on it is one of fewer trials."""


@dataclass(frozen=True, eq=False)
class Cone:
    """The mixtures of trials.

    Attributes:
        edges: unit vectors ``(d, k)`` along the trials; none ``(d, 0)`` where all directions count.
        mirrored: whether the opposite of every mixture counts, too.
    """

    edges: Array
    mirrored: bool

    @staticmethod
    def of(trials: Array, *, one_sided: bool, vector: bool) -> Cone:
        """The cone of trials.

        Args:
            trials: ``(d, k)`` in coordinates of the space that they span.
            one_sided: no trial's opposite makes sense.
            vector: the effect's size has several components, so that all directions make sense.
        """
        edges = trials / np.linalg.norm(trials, axis=0)
        if vector:
            return Cone(edges[:, :0], mirrored=False)
        if not one_sided:
            edges = edges * np.where(edges[:, 0] @ edges < 0.0, -1.0, 1.0)
        return Cone(edges, mirrored=not one_sided)

    @property
    def dimension(self) -> int:
        """Of the space that the trials span."""
        return len(self.edges)

    def explained(self, z: Array) -> Array:
        """Squares ``(n,)`` that the best mixtures take away from residuals ``(d, n)``."""
        if not self.edges.shape[1]:
            return np.sum(z**2, axis=0)
        result = self._projected(z)[0]
        return np.maximum(result, self._projected(-z)[0]) if self.mirrored else result

    def chance(self, squares: Array) -> Array:
        """p-value of squares explained, where the residual is white noise of unit variance."""
        whole: Array = chi2_sf(squares, self.dimension)
        if not self.edges.shape[1]:
            return whole
        ways = 2.0 if self.mirrored else 1.0
        parts = [w * chi2_sf(squares, j) for j, w in enumerate(self._weights) if j]
        return np.where(np.asarray(squares) > 0.0, np.minimum(ways * sum(parts), whole), 1.0)

    @cached_property
    def _weights(self) -> Array:
        """How often so many trials ``(d + 1,)`` share in a projection of noise."""
        if self.edges.shape[1] == 1:
            return np.array([0.5, 0.5])
        noise = np.random.default_rng(SEED).standard_normal((self.dimension, DRAWS))
        result: Array = np.bincount(self._projected(noise)[1], minlength=self.dimension + 1) / DRAWS
        return result

    @cached_property
    def _faces(self) -> list[tuple[Array, Array]]:
        """Edges ``(d, m)`` of every face, and the inverse ``(m, m)`` of their products."""
        d, k = self.edges.shape
        result = []
        for m in range(1, min(d, k) + 1):
            for own in combinations(range(k), m):
                face = self.edges[:, list(own)]
                products = face.T @ face
                if np.linalg.cond(products) < STEEP:
                    result.append((face, np.asarray(np.linalg.inv(products), dtype=float)))
        return result

    def _projected(self, z: Array) -> tuple[Array, np.ndarray]:
        """Squared length ``(n,)`` of projections onto the cone, and how many trials share in each."""
        best, active = np.zeros(z.shape[1]), np.zeros(z.shape[1], dtype=int)
        for face, inverse in self._faces:
            along = face.T @ z
            amounts = inverse @ along
            squares = np.sum(amounts * along, axis=0)
            # onto the cone: the longest projection onto one of its faces that needs no negative amount
            longer = (squares > best) & (amounts >= 0.0).all(axis=0)
            best[longer], active[longer] = squares[longer], face.shape[1]
        return best, active
