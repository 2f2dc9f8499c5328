"""`validate all`: studies and verification in their order, what they must show, and the report written."""
