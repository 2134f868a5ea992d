#!/usr/bin/env python3
"""The schema that the program prints accepts every example that it prints, and refuses a misspelt field.

    schema.py SOLVER        SOLVER is the built program

Needs the package jsonschema.
"""
import json
import subprocess
import sys

import jsonschema


def text(*arguments):
    return subprocess.run(arguments, check=True, capture_output=True, text=True, timeout=60).stdout


def main(solver):
    schema = json.loads(text(solver, "schema"))
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    validator = kind(schema)
    listing = text(solver, "example").split("\n\n")[0]  # below it stands how to use them
    names = [line.split()[0] for line in listing.splitlines()]
    wrong = [] if names else ["the program lists no example"]
    for name in names:
        case = json.loads(text(solver, "example", name))
        wrong += [f"{name}: {e.json_path}: {e.message}" for e in validator.iter_errors(case)]
        case["domain"]["spcing"] = 1.0
        if validator.is_valid(case):
            wrong.append(f"{name}: domain.spcing passes")
    print("\n".join(wrong) or f"{len(names)} examples agree with the schema")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
