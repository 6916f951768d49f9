#!/usr/bin/env python3
"""The JSON Schema of the job document agrees with the parser, the examples and the reference page.

Usage: job_schema_test.py SOURCE_FOLDER   (tests/unit/job_test.cpp holds the parser to the same list of documents)
"""
import json
import pathlib
import sys
import unittest

import jsonschema

SOURCE = pathlib.Path(sys.argv.pop() if len(sys.argv) > 1 else ".")
SCHEMA = json.loads((SOURCE / "server/job_schema.json").read_text())
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def merged(target, patch):
    """RFC 7396."""
    if not isinstance(patch, dict):
        return patch
    result = dict(target) if isinstance(target, dict) else {}
    for key, value in patch.items():
        if value is None:
            result.pop(key, None)
        else:
            result[key] = merged(result.get(key), value)
    return result


def property_names(schema):
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        for value in schema.values():
            yield from property_names(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from property_names(value)


class JobSchema(unittest.TestCase):
    def test_is_a_schema(self):
        jsonschema.Draft202012Validator.check_schema(SCHEMA)

    def test_judges_documents_as_the_parser_does(self):
        documents = json.loads((SOURCE / "tests/end_to_end/job_documents.json").read_text())
        self.assertGreater(len(documents["cases"]), 100)
        for case in documents["cases"]:
            document = merged(documents["base"], case["merge"])
            expected = case["refused_at"] is None or case.get("schema") == "accepts"
            with self.subTest(case["name"]):
                self.assertEqual(VALIDATOR.is_valid(document), expected,
                                 [error.message for error in VALIDATOR.iter_errors(document)])

    def test_accepts_every_example(self):
        examples = sorted((SOURCE / "clients/examples").glob("*.json"))
        self.assertGreater(len(examples), 4)
        for path in examples:
            with self.subTest(path.name):
                VALIDATOR.validate(json.loads(path.read_text()))
        for line in (SOURCE / "clients/examples/batch.jsonl").read_text().splitlines():
            VALIDATOR.validate(json.loads(line))

    def test_every_key_is_explained(self):
        page = (SOURCE / "server/README.md").read_text()
        for name in sorted(set(property_names(SCHEMA))):
            with self.subTest(name):
                self.assertIn(f"`{name}`", page)


if __name__ == "__main__":
    unittest.main()
