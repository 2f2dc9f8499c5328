"""The blind campaign: machines with a hidden cause, their readings, and how right a finder is about them.

What is here makes the data and knows the truth. It shares no code and no formula with the finder: it imports
neither `vjm_updating.mechanisms` nor `vjm_updating.diagnosis`, reads of a diagnosis only the files that it writes,
and takes the machine's numbers, not its mechanics, from the suite: a chain here is two elastic rods, integrated,
and the laws of its imperfections are others than a lumped finder has.
"""
