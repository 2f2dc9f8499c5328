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


class MechanismError(NoConvergenceError, ValueError):
    """A machine is asked about an end that moves without straining a spring: no load has an equilibrium there.

    It is bad input: another question has an answer, such as the machine with its end held.

    Example:
        >>> import vjm
        >>> try:
        ...     vjm.stiffness(vjm.load("orthoglide-chain"), gravity=(0.0, 0.0, -9.81))
        ... except vjm.MechanismError as error:
        ...     print("it is a mechanism" in str(error))
        True
    """
