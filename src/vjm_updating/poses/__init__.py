"""Robots measured by where they are: joint coordinates and tracked poses under the robot's own weight."""
