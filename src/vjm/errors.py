"""What a solver raises when it gives up."""


class NoConvergenceError(RuntimeError):
    """A solver stopped before the residual was small; the message says how far it came."""


class UndecidedError(NoConvergenceError):
    """Rounding leaves a question open; the message says which and what makes it decidable."""
