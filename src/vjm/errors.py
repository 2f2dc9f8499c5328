"""What a solver raises when it gives up."""


class NoConvergenceError(RuntimeError):
    """A solver stopped before the residual was small; the message says how far it came.

    Example:
        >>> import vjm
        >>> try:
        ...     vjm.stiffness(vjm.load("planar-2r"), "stretched", wrench=(-5e3, 0, 0, 0, 0, 0))
        ... except vjm.NoConvergenceError as error:
        ...     print("unstable" in str(error))
        True
    """


class UndecidedError(NoConvergenceError):
    """Rounding leaves a question open; the message says which and what makes it decidable."""
