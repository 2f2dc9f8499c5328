"""What a machine may do that its model lacks: one small file an effect, and the machinery that they share.

`vjm_updating.mechanisms.effect` says what an effect is; `vjm_updating.mechanisms.catalogue` lists those that there
are and takes more.
"""
