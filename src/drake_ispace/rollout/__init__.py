"""The same Diagram at machine speed."""
