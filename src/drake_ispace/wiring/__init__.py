"""Who is connected to whom, and nothing else; `catalog.py` lists the Diagrams by name."""
