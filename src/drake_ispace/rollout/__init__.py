"""A Diagram at machine speed."""
