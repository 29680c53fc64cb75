#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
#
# Checks the JSON files of a run folder against app/io/schema: check_products.py SCHEMAS FOLDER [FILE..]
# Without names every file that has a schema is checked. Then every key of each is left out and misspelt,
# one at a time, and the schema must refuse that too: a check that cannot fail is none.
# Needs python3-jsonschema (4.0 or later). Exit codes: 0 all valid, 1 faults (printed), 77 no jsonschema.
import json
import pathlib
import sys

try:
    import jsonschema
    from jsonschema import Draft202012Validator
except ImportError as missing:
    print(f"SKIPPED: {missing} (apt-get install python3-jsonschema)")
    sys.exit(77)

# Files that are written by another name.
OTHER_NAMES = {"dynamics_trace.json": "trace"}
# Places whose keys are data (run.json), and keys that are not always written.
FREE_KEYS = ("/options",)
OPTIONAL = ("/gravity_base", "/joints/*/range", "/accepted/*/at", "/candidates/*/held_out", "/not_found/*/record")


def read(path):
    def refuse(word):
        raise ValueError(f"{path}: {word} is no JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def make_validator(schema, schemas):
    """A validator whose references to other files are found among `schemas` (by file name)."""
    try:
        from referencing import Registry, Resource  # jsonschema 4.18 and later
    except ImportError:
        resolver = jsonschema.RefResolver("", schema, store=schemas)
        return Draft202012Validator(schema, resolver=resolver)
    registry = Registry().with_resources(
        (name, Resource.from_contents(one)) for name, one in schemas.items())
    return Draft202012Validator(schema, registry=registry)


def shape(value):
    """The keys of a value, all the way down."""
    if isinstance(value, dict):
        return tuple((key, shape(one)) for key, one in sorted(value.items()))
    if isinstance(value, list):
        return tuple(shape(one) for one in value)
    return ""


def thinned(value):
    """The same document with one object of each kind in its lists: small, with every key that it has."""
    if isinstance(value, dict):
        return {key: thinned(one) for key, one in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        kinds = {}
        for one in value:
            kinds.setdefault(shape(one), one)
        return [thinned(one) for one in kinds.values()]
    if isinstance(value, list) and value and isinstance(value[0], list):
        return value[:1]
    return value


def objects(value, place=""):
    """Every object of a document with its place, list indices as *."""
    if isinstance(value, dict):
        yield place, value
        for key, one in list(value.items()):
            yield from objects(one, f"{place}/{key}")
    elif isinstance(value, list):
        for one in value:
            yield from objects(one, f"{place}/*")


def mutation_faults(validator, document):
    """Keys whose absence or other spelling the schema takes, and how many were tried."""
    document = thinned(document)
    faults, tried = [], 0
    for place, one in objects(document):
        if place in FREE_KEYS:
            continue
        for key in list(one):
            name = f"{place}/{key}"
            value = one.pop(key)
            tried += 1
            if not name.endswith(OPTIONAL) and validator.is_valid(document):
                faults.append(f"{name} may be left out")
            one[key + "_"] = value
            if validator.is_valid(document):
                faults.append(f"{name} may be misspelt")
            del one[key + "_"]
            one[key] = value
    return sorted(set(faults)), tried


def check(path, schemas):
    """What is wrong with a file, one line a fault; prints what was done."""
    name = OTHER_NAMES.get(path.name, path.stem)
    validator = make_validator(schemas[f"{name}.schema.json"], schemas)
    document = read(path)
    faults = [f"{error.json_path}: {error.message[:300]}" for error in validator.iter_errors(document)]
    if faults:
        return faults
    faults, tried = mutation_faults(validator, document)
    print(f"{path.name}: valid, {tried} keys tried")
    return faults


def main(arguments):
    schema_folder, folder = pathlib.Path(arguments[0]), pathlib.Path(arguments[1])
    schemas = {path.name: read(path) for path in sorted(schema_folder.glob("*.schema.json"))}
    for schema in schemas.values():
        Draft202012Validator.check_schema(schema)
    known = [name.replace(".schema", "") for name in schemas] + sorted(OTHER_NAMES)
    names = arguments[2:] or [name for name in known if (folder / name).exists()]
    failed = not names
    if failed:
        print(f"{folder}: no file that has a schema")
    for name in names:
        for fault in check(folder / name, schemas):
            print(f"{name}: {fault}")
            failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
