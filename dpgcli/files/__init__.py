"""The only readers and writers: specs in YAML, tables of results."""
