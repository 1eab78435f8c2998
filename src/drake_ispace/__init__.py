"""Two mobile robots in an intelligent space, as Drake Diagrams."""
