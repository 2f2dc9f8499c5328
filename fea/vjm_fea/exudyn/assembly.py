"""Two systems of Exudyn side by side: a machine, and the same without its beams.

What joints and springs put up is differenced in the second one. In the first, rounding of the positions strains the
beams' elements, and a short one answers with more force than the difference that is looked for.
"""

from __future__ import annotations

from vjm_fea.exudyn.backend import Description, Item, exu


class ExudynAssembly:
    """Nodes, markers, joints and springs in both systems, beams in the first.

    Attributes:
        whole: the main system of the machine.
        unmeshed: that of the same nodes without the beams between them.
    """

    def __init__(self) -> None:
        """Two empty systems."""
        exu.config.printToConsole = False
        # the container owns the systems: without it they die
        self._container = exu.SystemContainer()
        self.whole, self.unmeshed = self._container.AddSystem(), self._container.AddSystem()
        self._beams: list[Description] = []

    def node(self, item: Description) -> Item:
        """Add a node; its number."""
        self.unmeshed.AddNode(item)
        return self.whole.AddNode(item)

    def marker(self, item: Description) -> Item:
        """Add a marker; its number."""
        self.unmeshed.AddMarker(item)
        return self.whole.AddMarker(item)

    def rigid(self, item: Description) -> Item:
        """Add a rigid body, a joint or a spring; its number, the same in both systems."""
        self.unmeshed.AddObject(item)
        return self.whole.AddObject(item)

    def beam(self, item: Description) -> None:
        """Add a beam's element, behind all that both systems have."""
        self._beams.append(item)

    def close(self) -> None:
        """Assemble both."""
        for item in self._beams:
            self.whole.AddObject(item)
        self.whole.Assemble()
        self.unmeshed.Assemble()
