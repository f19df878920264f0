"""`dpg schema`: the JSON Schema of the spec."""

from dpgcli.cli.streams import put_json


def schema() -> None:
    """Print the JSON Schema of the spec, for editors."""
    import json

    from dpgcli.files.scene_file import json_schema

    put_json(json.dumps(json_schema(), indent=2) + "\n")
