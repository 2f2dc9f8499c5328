"""The report of a run: one page in plain words with the figures, renders and tables behind them.

`findings` and `words` say what was found; `figures`, `chapter_figures`, `scenes` and `machine_view` draw it.
`chapters` are those on whole robots and on the discovery; `page` puts them together.
`command_pages` serves single commands.
"""
