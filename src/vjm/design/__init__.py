"""What a designer asks of a loaded machine.

- `linear_state`: an equilibrium with its small motions. `changes`: the same with another value of a parameter.
- `shares`, `sensitivity`, `critical`, `modes`: what deflects, what it depends on, when it buckles, how it vibrates.
- `space`: a machine whose numbers vary. `sweep` evaluates it on a grid, `optimum` makes it best, and `best_machine`
  chooses standard parts too.
"""
