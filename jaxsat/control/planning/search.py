"""Search for a plan in pieces: a number of iterations at a time, resumed where it stopped."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.guesses import guess, random_numbers, resampled
from jaxsat.control.planning.interior_point import Iterate, Settings, begun, iterated
from jaxsat.control.planning.transcription import Transcription, Unknowns
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.checks import require_counts, require_finite, require_positive
from jaxsat.core.trees import choose

ROUGH = Settings(first_barrier=1e-2, last_barrier=3e-4, proximity=0.1, iterations=30)
"""Settings of the search from every guess."""

CLOSE = Settings(first_barrier=5e-4, last_barrier=3e-5, proximity=0.01, iterations=60)
"""Settings of the search from the best guess, and from the rest of an earlier plan."""

ARRIVING = 1e-4
"""Largest dimensionless sum of defects of a plan that arrives."""

CREDIBLE, CREDIBLE_SHARE, UNSOUND = 1e-2, 0.1, 1e3
"""Above this sum of defects, or this share of the start's own arrival error, a rough plan is chosen
only if none is below; the third number is added to its worth."""


CLOSING = 20
"""Iterations that improve the best guess, in nearly all searches: the median is 9 or 10."""

GUESSED = 1.2
"""Smallest ratio of a guess's duration to the shortest permitted one."""


class Search(NamedTuple):
    """State of a search.

    `stage` is the number of the current guess, then that of the guesses while the best is being
    improved, and one more at the end. `fresh` marks a stage without iterations. `best` has the
    duration `worth`; `begin` (in units of τ) and `start` are those of the plan, which takes at
    least `least` (τ).
    """

    stage: IntScalar
    fresh: BoolScalar
    iterate: Iterate
    best: Unknowns
    worth: RealScalar
    begin: RealScalar
    start: Float[Array, "7"]
    least: RealScalar


class PlanSearch(eqx.Module):
    """Minimum time from `guesses` paths to the target, in pieces of at most `iterations`.

    A plan from the guesses takes at least `shortest` (τ), see `Settings.least_duration`.
    """

    guesses: int = eqx.field(static=True, default=12)
    iterations: int = eqx.field(static=True, default=20)
    shortest: float = eqx.field(static=True, default=1.0)

    def __check_init__(self):
        require_counts(guesses=self.guesses, iterations=self.iterations)
        require_positive("shortest", self.shortest)
        require_finite("shortest", self.shortest)

    @property
    def most_pieces(self) -> int:
        """Largest number of pieces of a search from all guesses."""
        rough, close = int(ROUGH.iterations) + 1, int(CLOSE.iterations) + 1
        return -(-(self.guesses * rough + close) // self.iterations)

    @property
    def closing_pieces(self) -> int:
        """Number of pieces that nearly always suffices to improve the best guess."""
        return -(-CLOSING // self.iterations)

    @property
    def most_closing_pieces(self) -> int:
        """Largest number of pieces to improve the best guess."""
        return -(-(int(CLOSE.iterations) + 1) // self.iterations)

    def idle(self, program: Transcription) -> Search:
        """A search that has ended without a plan."""
        x, zero = program.target, jnp.zeros_like(program.limit)
        shape = jax.eval_shape(lambda: begun(program, zero, self._guess(program, x, 0), ROUGH))
        nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
        over = jnp.array(self.guesses + 1)
        return Search(over, jnp.array(False), nothing, nothing.unknowns, zero, zero, x, zero)

    def from_guesses(self, search: Search, begin: RealScalar, x: Float[Array, "7"]) -> Search:
        """A new search, for a plan from `x` at the time `begin`."""
        worth = jnp.full_like(begin, jnp.inf)
        first, yes = jnp.zeros_like(search.stage), jnp.array(True)
        least = jnp.full_like(begin, self.shortest)
        of_plan = {"worth": worth, "begin": begin, "start": x, "least": least}
        return search._replace(stage=first, fresh=yes, **of_plan)

    def near(
        self,
        program: Transcription,
        search: Search,
        begin: RealScalar,
        x: Float[Array, "7"],
        plan: Unknowns,
        elapsed: RealScalar,
    ) -> Search:
        """A search from the rest of a `plan`, after the time `elapsed` of it."""
        best = resampled(program, in_hemisphere_of(plan.states[0], x), plan, elapsed)
        stage, yes = jnp.full_like(search.stage, self.guesses), jnp.array(True)
        of_plan = {"best": best, "begin": begin, "start": best.states[0]}
        return search._replace(stage=stage, fresh=yes, **of_plan, least=jnp.zeros_like(begin))

    def over(self, search: Search) -> BoolScalar:
        """Whether the search has ended."""
        return search.stage > self.guesses

    def arrives(self, search: Search) -> BoolScalar:
        """Whether the search has ended with a plan that arrives; false for NaN."""
        return self.over(search) & (search.iterate.defects < ARRIVING)

    def advanced(
        self, program: Transcription, search: Search, begin: RealScalar, x: Float[Array, "7"]
    ) -> Search:
        """The search after one more piece.

        If the piece begins to improve the best guess, the plan is from `x` at the time `begin`.
        """

        def under_way(at: tuple[Search, Array]):
            return ~self.over(at[0]) & (at[1] < self.iterations)

        def one(at: tuple[Search, Array]):
            search, count = at
            after = lax.cond(search.fresh, self._started, self._iterated, program, search, begin, x)
            return after, count + 1

        return lax.while_loop(under_way, one, (search, jnp.array(0)))[0]

    def _guess(self, program: Transcription, x: Float[Array, "7"], number) -> Unknowns:
        table = {name: jnp.asarray(rows) for name, rows in random_numbers(self.guesses).items()}
        numbers = {name: rows[number] for name, rows in table.items()}
        return guess(program, x, numbers, least=GUESSED * self.shortest)

    def _settings(self, search: Search) -> Settings:
        rough = search.stage < self.guesses
        settings = (jnp.where(rough, a, b) for a, b in zip(ROUGH, CLOSE, strict=True))
        return Settings(*settings)._replace(least_duration=search.least)

    def _started(self, program: Transcription, search: Search, begin, x) -> Search:
        rough = search.stage < self.guesses
        number = jnp.minimum(search.stage, self.guesses - 1)
        guess = self._guess(program, search.start, number)
        first = choose(rough, guess, search.best)
        now = in_hemisphere_of(first.states[0], x)
        start = jnp.where(rough, search.start, now)
        first = first._replace(states=first.states.at[0].set(start))
        begin = jnp.where(rough, search.begin, begin)
        iterate = begun(program, begin, first, self._settings(search))
        return search._replace(fresh=jnp.array(False), iterate=iterate, begin=begin, start=start)

    def _iterated(self, program: Transcription, search: Search, begin, x) -> Search:
        settings = self._settings(search)
        iterate = iterated(program, search.begin, search.iterate, settings)
        ended = iterate.done | (iterate.iterations >= settings.iterations)
        worth = worth_of(program, search.start, iterate)
        better = ended & (worth < search.worth)
        best = choose(better, iterate.unknowns, search.best)
        return search._replace(
            stage=search.stage + ended.astype(search.stage.dtype),
            fresh=ended,
            iterate=iterate,
            best=best,
            worth=jnp.where(better, worth, search.worth),
        )


def worth_of(program: Transcription, x: Float[Array, "7"], solution: Iterate) -> RealScalar:
    """Merit of a rough plan from `x`, to be minimised: the objective (τ), far above it for a plan
    that does not arrive, infinite for NaN."""
    defects = solution.defects
    miss = jnp.sum(jnp.abs(program.arrival(x)))
    credible = defects < jnp.minimum(CREDIBLE, CREDIBLE_SHARE * miss)
    worth = program.value(solution.unknowns) + jnp.where(credible, 0.0, UNSOUND * (1 + defects))
    return jnp.where(jnp.isfinite(worth), worth, jnp.inf)


def in_hemisphere_of(reference: Float[Array, "7"], x: Float[Array, "7"]) -> Float[Array, "7"]:
    """The same state with its quaternion in the hemisphere of another's."""
    sign = jnp.where(jnp.sum(x[:4] * reference[:4]) < 0, -1.0, 1.0)
    return jnp.concatenate([sign * x[:4], x[4:]])
