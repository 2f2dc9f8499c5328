"""The report of a run: one page in plain words with the figures, renders and tables behind them."""

from vjm_validation.report.page import write_report

__all__ = ["write_report"]
