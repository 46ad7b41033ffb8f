#!/bin/sh
# Prints a Python that PipeGUI runs on: 3.11 to 3.14, the best tested first. Fails if there is none.
for python in python3.11 python3.12 python3.13 python3.14 python3; do
    if "$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null; then
        command -v "$python"
        exit 0
    fi
done
exit 1
