"""A pinned bar of rigid links between viscoelastic hinges, pushed along its axis and integrated in time.

By Newton's method on the links' angles at every step, with nothing of the package in it.
"""

import numpy as np

LENGTH, EA, EI = 299.085, 68948.0 * 25.4 * 3.175, 68948.0 * 25.4 * 3.175**3 / 12.0
"""mm, N, N mm²: those of the model `pinned-column`."""
BUCKLES = np.pi**2 * EI / LENGTH / EA
"""mm."""
LINKS = 48
"""Euler's load is 1 − (π/96)²/3 of a bar's, 0.04 % less."""
BOW = 1e-8
"""rad that the hinge in the middle is turned by when unloaded, so that it is known which way the bar bends."""


def push(time, displacement, shares=(), times=()):
    """Axial force ``(n,)``, positive in push; its hinges and its axial spring are standard linear solids.

    Args:
        time: s ``(n,)``, in steps much shorter than what relaxes.
        displacement: ``(n,)``, from zero.
        shares: of the stiffness that relax.
        times: of their relaxation, s.
    """
    part = LENGTH / LINKS
    at_hinge, at_end = EI / part, EA / LENGTH
    turn = np.diff(np.eye(LINKS), axis=0)
    rest = BOW * np.sin(np.pi * np.arange(1, LINKS) / LINKS)
    mode = np.cos(np.pi * (np.arange(LINKS) + 0.5) / LINKS)
    shares, times = np.array(shares), np.array(times)
    angle, across = -1e-8 * mode, 0.0
    # the hinges' turns and the shortening of the spring
    last = np.append(turn @ angle - rest, 0.0)
    history = np.zeros((len(shares), LINKS))
    force = np.zeros(len(time))
    for k in range(1, len(time)):
        ratio = (time[k] - time[k - 1]) / times
        decay = np.exp(-ratio)
        end = 1.0 - (1.0 - decay) / ratio
        past = decay[:, None] * history + np.outer(1.0 - decay - end, last)
        past_hinge, past_end = np.split(shares @ past, [LINKS - 1])
        left = 1.0 - shares @ end
        if displacement[k] > BUCKLES and abs(angle[0]) < 1e-3:
            # off the straight bar, which stands there but not stably
            angle = angle + 1e-2 * mode * (np.sign(angle[0]) or 1.0)
        for _ in range(80):
            sine, cosine = np.sin(angle), np.cos(angle)
            now = np.append(turn @ angle - rest, displacement[k] - part * np.sum(1.0 - cosine))
            moment = at_hinge * (left * now[:-1] - past_hinge)
            force[k] = at_end * (left * now[-1] - past_end[0])
            off = turn.T @ moment - force[k] * part * sine + across * part * cosine
            K = left * at_hinge * turn.T @ turn + left * at_end * part**2 * np.outer(sine, sine)
            K -= np.diag(part * (force[k] * cosine + across * sine))
            J = np.block([[K, part * cosine[:, None]], [part * cosine, np.zeros(1)]])
            step = np.linalg.solve(J, -np.append(off, part * sine.sum()))
            most = np.abs(step[:-1]).max()
            step *= min(1.0, 0.02 / most)
            angle, across = angle + step[:-1], across + step[-1]
            if most < 1e-10:
                break
        else:
            raise AssertionError(f"the bar is in no balance at {time[k]} s")
        history, last = past + np.outer(end, now), now
    return force
