import pytest
from hidden_effects.designs import small_design
from hidden_effects.signatures import Signatures, signatures
from hidden_effects.virtual_rig import Design


@pytest.fixture(scope="session")
def design() -> Design:
    return small_design()


@pytest.fixture(scope="session")
def known(design: Design) -> Signatures:
    return signatures(design)
