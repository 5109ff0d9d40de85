# SPDX-License-Identifier: GPL-2.0-or-later
"""Reports against their JSON Schemas.

json_schema.py SCHEMAS FILE...  each JSON object of each FILE, which holds one or one a line, by the
                                schema that its first key names
json_schema.py --check SCHEMAS  the schemas themselves
json_schema.py --manual SCHEMAS MAN...  whether a manual page that the command's own names has each key
json_schema.py --mutate SCHEMAS FILE... whether a key more, and a key less, is found in each object

Prints each difference and exits with 1; prints nothing and exits with 0 if there is none.
"""
import json
import os
import re
import sys

import jsonschema

try:
    import referencing
except ImportError:  # Debian 12
    referencing = None


def name_of(file):
    """"calibrate-force.json" describes "incise/calibrate/force/1"."""
    return "incise/" + os.path.basename(file)[:-5].replace("-", "/") + "/1"


def read(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


class Schemas:
    def __init__(self, folder):
        self.folder = folder
        self.store = {}
        for file in os.listdir(folder):
            if file.endswith(".json"):
                self.store[f"file:///{file}"] = read(os.path.join(folder, file))

    def validator(self, uri):
        """Schemas refer to each other by the names of their files."""
        if not referencing:
            resolver = jsonschema.RefResolver(uri, self.store[uri], store=self.store)
            return jsonschema.Draft202012Validator(self.store[uri], resolver=resolver)
        registry = referencing.Registry().with_resources(
            (name, referencing.Resource.from_contents(one)) for name, one in self.store.items())
        return jsonschema.Draft202012Validator({"$ref": uri}, registry=registry)

    def differences(self, report):
        name = report.get("schema") if isinstance(report, dict) else None
        found = re.fullmatch(r"incise/([a-z/]+)/(\d+)", name or "")
        if not found:
            return ["no schema is named"]
        if next(iter(report)) != "schema":
            return ["schema is not the first key"]
        uri = f"file:///{found[1].replace('/', '-')}.json"
        if uri not in self.store:
            return [f"{name}: there is no such schema"]
        validator = self.validator(uri)
        wrong = []
        for error in validator.iter_errors(report):
            # What is wrong with the variant that it is most like.
            for one in [error, *sorted(error.context, key=lambda e: -len(e.absolute_path))[:3]]:
                path = ".".join(str(part) for part in one.absolute_path)
                wrong.append(f"{path}: {one.message[:200]}")
        return wrong


def reports_in(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    try:
        return [json.loads(text)]
    except json.JSONDecodeError:
        return [json.loads(line) for line in text.splitlines()]


def leaves(schema, path=""):
    """(path, schema) of each property, wherever it is."""
    if not isinstance(schema, dict):
        return
    for key in ("properties", "patternProperties"):
        for name, one in schema.get(key, {}).items():
            yield f"{path}.{name}", one
            yield from leaves(one, f"{path}.{name}")
    for name, one in schema.get("$defs", {}).items():
        yield from leaves(one, f"{path}.{name}")
    for key in ("items", "additionalProperties"):
        yield from leaves(schema.get(key), path)


UNITS = {
    "N": "N", "mm": "mm", "ns": "ns", "ms": "ms", "us": "µs", "s": "s", "hz": "Hz", "deg": "degrees", "px": "px",
    "bytes": "bytes", "ppm": "ppm", "percent": "%", "mV": "mV", "kg": "kg", "MB": "MB", "KiB": "KiB", "ul": "µl",
}


def check(folder):
    wrong = []
    for file in sorted(os.listdir(folder)):
        schema = read(os.path.join(folder, file))
        try:
            jsonschema.Draft202012Validator.check_schema(schema)
        except jsonschema.SchemaError as error:
            wrong.append(f"{file}: {error.message}")
        if file != "bench.json" and schema["properties"]["schema"] != {"const": name_of(file)}:
            wrong.append(f"{file}: is not of {name_of(file)}")
        if not any(key in schema for key in ("additionalProperties", "unevaluatedProperties", "$defs")):
            wrong.append(f"{file}: allows unknown keys")
        for path, one in leaves(schema):
            name = path.rsplit(".", 1)[1]
            unit = UNITS.get(name.rsplit("_", 1)[1]) if "_" in name else None
            if name == "schema" or not isinstance(one, dict) or "$ref" in one:
                continue
            # A group of counts, such as flags, is described as a whole.
            if unit and "number" in str(one.get("type")) and unit not in one.get("description", unit):
                wrong.append(f"{file}: {path}: the description lacks the unit {unit}")
    return wrong


def words_of(page):
    with open(page, encoding="utf-8") as file:
        return file.read()


def manual(folder, pages):
    """Each key is in the command's page, or in one that it refers to."""
    texts = {os.path.basename(page).rsplit(".", 1)[0]: words_of(page) for page in pages}
    wrong = []
    for file in sorted(os.listdir(folder)):
        page = "incise-" + file[:-5]
        text = texts[page if page in texts else "incise-bench"] + texts["incise"]
        for other in re.findall(r"^\.Xr (\S+)", text, re.MULTILINE):
            text += texts.get(other, "")
        words = set(re.findall(r"[A-Za-z]\w*", text))
        for path, _ in leaves(read(os.path.join(folder, file))):
            name = path.rsplit(".", 1)[1]
            # Limits of an interval are described as suffixes; a pattern is no name.
            if "^" not in name and not words & {name, re.sub("_(low|high|p5|p95)$", "", name)}:
                wrong.append(f"{file}: {path}: the manual does not name it")
    return wrong


def objects(value, path=""):
    """(path, object) of each object, of lists the first one."""
    if isinstance(value, dict):
        yield path, value
        for key, one in value.items():
            yield from objects(one, f"{path}.{key}")
    elif isinstance(value, list) and value:
        yield from objects(value[0], path)


# Objects whose keys are those of a model, a tracker or a device.
OPEN = re.compile(r"\.(rows|flags|counters|actuator|in_force|criteria|train|check|mean|linear|knn|devices)$|^$")


def mutate(schemas, path):
    report = reports_in(path)[0]
    for where, one in list(objects(report)):
        one["no_such_key"] = {}
        if not schemas.differences(report):
            yield f"{where}: an unknown key is not found"
        del one["no_such_key"]
        if where == "" or OPEN.search(where):
            continue
        for key in list(one):
            value = one.pop(key)
            if not schemas.differences(report):
                yield f"{where}.{key}: is not missed"
            one[key] = value


def main(arguments):
    if arguments[0] == "--check":
        wrong = check(arguments[1])
    elif arguments[0] == "--manual":
        wrong = manual(arguments[1], arguments[2:])
    elif arguments[0] == "--mutate":
        schemas = Schemas(arguments[1])
        wrong = [f"{os.path.basename(path)}: {line}" for path in arguments[2:] for line in mutate(schemas, path)]
    else:
        schemas = Schemas(arguments[0])
        wrong = [f"{os.path.basename(path)}: {line}" for path in arguments[1:]
                 for report in reports_in(path) for line in schemas.differences(report)]
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
