"""A machine to turn in one's hands.

`state` is what the sliders set and what the machine answers, `drawing` its surfaces, `jobs` what runs beside,
and `page` what the browser shows.
"""
