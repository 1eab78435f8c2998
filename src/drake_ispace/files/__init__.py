"""All that touches a disk: recordings, importers, strict YAML, paths."""
