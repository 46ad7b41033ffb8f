#!/bin/sh
# Detects on a scan, writes the report, and shows the scan in the app: demo.sh SCAN REPORT_FOLDER.
# Without a display the app draws into a virtual one and saves a picture beside the report.
set -eu
cd "$(dirname "$0")/.."
scan=$1 report=$2

mkdir -p "$(dirname "$report")"
.venv/bin/pipecore detect "$scan" -o "$report" --overwrite
if [ "$(uname -s)${DISPLAY:-}${WAYLAND_DISPLAY:-}" != Linux ]; then
    echo "Opening $scan in PipeGUI …"
    .venv/bin/pipegui "$scan" --detect
else
    xvfb-run -a -s "-screen 0 1600x1000x24" \
        .venv/bin/pipegui "$scan" --detect --screenshot "$report/app.png"
    echo "No display here: the app's picture is $report/app.png."
fi
