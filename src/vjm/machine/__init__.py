"""Any machine as one tree of parts with closed loops: where it comes from, and how it closes."""
