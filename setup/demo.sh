#!/bin/sh
# Render a short walkthrough of ROOM and write its report. $1: folder of the commands; $2: run folder.
set -eu
commands=$1
run=$2
scene=build/demo

echo "demo: writing the scene ROOM into $scene"
"$commands/python" -m studies scene room --preset small --out "$scene" >/dev/null
echo "demo: rendering 50 frames into $run; after an interruption the same command continues"
"$commands/enfilade" render "$scene/scene.xml" --path "$scene/camera_path.json" --frames 11-60 --out "$run"
"$commands/enfilade" report "$run"
