"""The report of a run: one page in plain words with the figures, renders and tables behind them."""
