"""Foreign libraries that read files, without the process of their own that each file has."""

import pytest

from vjm.io import foreign_readers


@pytest.fixture
def readers_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read in this process: a child takes longer to start than to read. `test_mjcf.py` has the children."""
    monkeypatch.setattr(foreign_readers, "run_in_child", lambda function, *arguments, **_: function(*arguments))
