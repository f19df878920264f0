"""`dpg schema`: the JSON Schema of the spec."""


def schema() -> None:
    """Print the JSON Schema of the spec, for editors."""
    import json

    from dpgcli.files.scene_file import json_schema

    print(json.dumps(json_schema(), indent=2))
