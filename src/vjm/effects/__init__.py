"""What a machine may do that its model lacks: one small file an effect, and the machinery that they share.

`vjm.effects.effect` says what an effect is; `vjm.effects.catalogue` lists those that there are and takes more.
"""
