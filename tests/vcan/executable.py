"""Prints the path of the test executable NAME from the JSON messages of `cargo test --no-run` on standard input."""

import json
import sys

for line in sys.stdin:
    message = json.loads(line)
    if message.get("executable") and message["target"]["name"] == sys.argv[1] and message["profile"]["test"]:
        print(message["executable"])
