"""Every shipped configuration keeps to the JSON Schema of its binary; one with a slip does not.

Usage: schema_test.py CONFIGS UNIPHY_SIMULATE BINARY... The binary of configs/train/*.yaml is
uniphy_train. Skipped (77) where PyYAML or jsonschema is missing.
"""
import copy
import json
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    import jsonschema
    import yaml
except ImportError as error:
    print("skipped: %s (Debian: python3-yaml, python3-jsonschema)" % error)
    sys.exit(77)

STAGES = {"ablation": "ablate"}  # of the folders that are not called like their stage


class Yaml12(yaml.SafeLoader):
    """Plain values as YAML 1.2 and editors read them: 5e-4 is a number, no is a text."""


Yaml12.yaml_implicit_resolvers = {}
for tag, pattern, first in (
        ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
        ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
        ("int", r"[-+]?[0-9]+", list("-+0123456789")),
        ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)",
         list("-+.0123456789"))):
    Yaml12.add_implicit_resolver("tag:yaml.org,2002:" + tag, re.compile("^(?:%s)$" % pattern),
                                 first)
# A number without a point is one of YAML 1.2, and Python's own reader takes it.
Yaml12.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(node.value))
Yaml12.add_constructor("tag:yaml.org,2002:float",
                       lambda loader, node: float(node.value.replace(".inf", "inf")))


def places(value, path=()):
    """Every value of a document with its path."""
    yield path, value
    items = value.items() if isinstance(value, dict) else (
        enumerate(value) if isinstance(value, list) else ())
    for key, inner in items:
        yield from places(inner, path + (key,))


def with_value(document, path, value):
    changed = copy.deepcopy(document)
    at = changed
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return changed


def slips(document):
    """The document with an unknown key in one of its maps, or a value of another type."""
    for path, value in places(document):
        if isinstance(value, dict):
            yield path, with_value(document, path + ("misspelt_key",), 1)
        if path:
            wrong = [1] if isinstance(value, dict) else {"wrong": 1}
            yield path, with_value(document, path, wrong)
        if isinstance(value, (bool, int, float, list)):
            yield path, with_value(document, path, "wrong")


class Schema:
    def __init__(self, binary):
        done = subprocess.run([str(binary), "--schema"], capture_output=True, text=True)
        assert done.returncode == 0 and not done.stderr, (binary, done.stderr)
        schema = json.loads(done.stdout)
        jsonschema.Draft202012Validator.check_schema(schema)
        self.bytes = len(done.stdout)
        self.validator = jsonschema.Draft202012Validator(schema)

    def check(self, name, document):
        error = jsonschema.exceptions.best_match(self.validator.iter_errors(document))
        assert error is None, "%s: %s: %s" % (name, list(error.absolute_path), error.message)

    def refuse(self, name, document):
        assert not self.validator.is_valid(document), "%s: expected a refusal" % (name,)


def check_shipped(configs, binaries):
    counts = [0, 0]
    schemas = {}
    for file in sorted(configs.glob("*/*.yaml")):
        folder = file.parent.name
        name = "uniphy_" + STAGES.get(folder, folder)
        if name not in binaries:
            assert name == "uniphy_bench", name  # which is built where google-benchmark is
            continue
        if name not in schemas:
            schemas[name] = Schema(binaries[name])
        schema = schemas[name]
        document = yaml.load(file.read_text(encoding="utf-8"), Yaml12) or {}
        schema.check(file, document)
        counts[0] += 1
        for path, wrong in slips(document):
            schema.refuse((file, path), wrong)
            counts[1] += 1
    assert set(schemas) == set(binaries), set(binaries) - set(schemas)  # each ships a configuration
    return counts


def check_scene(configs, simulate):
    """What the configurations do not show: ranges, choices, words, required keys, config.yaml."""
    schema = Schema(simulate)
    text = (configs / "simulate/benchmark_cube.yaml").read_text(encoding="utf-8")
    scene = yaml.load(text, Yaml12)
    for path, value in ((("scene", "grid"), 1), (("scene", "grid"), 20.5), (("scene", "dt"), 0),
                        (("scene", "dt"), "soon"), (("bodies",), []), (("bodies",), None),
                        (("bodies", 0, "shape"), {"type": "bxo"}),
                        (("bodies", 0, "shape"), {"type": "box", "radius": 1}),
                        (("bodies", 0, "law"), {"type": "elastic", "mu": -1, "lambda": 1}),
                        (("bodies", 0, "law"), {}), (("bodies", 0, "center"), [0.5, 0.5])):
        schema.refuse(path, with_value(scene, path, value))
    for path, value in ((("scene", "dt"), "auto"), (("output",), None), (("bodies", 0, "name"), 7),
                        (("bodies", 0, "shape"), {"sides": [1, 1, 2]}),  # a box: the default
                        (("bodies", 0, "shape"), {"type": "sphere", "radius": 1})):
        schema.check(path, with_value(scene, path, value))
    schema.refuse("no bodies", {})
    with tempfile.TemporaryDirectory() as out:
        command = [str(simulate), str(configs / "simulate/two_bodies.yaml"), "--out", out]
        for assignment in ("scene.duration=none", "scene.steps=1", "output.picture_frames=0"):
            command += ["--set", assignment]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        text = (pathlib.Path(out) / "config.yaml").read_text(encoding="utf-8")
        schema.check("config.yaml", yaml.load(text, Yaml12))


def main():
    configs = pathlib.Path(sys.argv[1])
    binaries = {pathlib.Path(name).name: name for name in sys.argv[2:]}
    check_scene(configs, sys.argv[2])
    print("%d configurations, %d slips: passed" % tuple(check_shipped(configs, binaries)))


if __name__ == "__main__":
    main()
