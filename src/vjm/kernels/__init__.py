"""Compiled kernels: a lumped model as flat arrays, its kinematics, factorisation and solutions."""
