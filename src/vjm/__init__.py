"""The virtual joint method for manipulators under load.

Rigid links, perfect passive joints and lumped six-dimensional springs, after Pashkevich, Klimchik and
Chablat, *Nonlinear Effects in Stiffness Modeling of Robotic Manipulators*. Equation numbers in this package
are that paper's. Units inside are N, mm and rad.
"""

__version__ = "0.1.0"
