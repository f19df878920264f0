"""`dpg schema`: the JSON Schema of the spec."""


def schema() -> None:
    """Print the JSON Schema of the spec, with which editors complete and check it."""
    import json

    from dpgcli.files.spec import json_schema

    print(json.dumps(json_schema(), indent=2))
