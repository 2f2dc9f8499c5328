"""How results are written: JSON, versions, figures, pages and terminal tables."""
